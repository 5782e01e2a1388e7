/// `imuscope decode` as a user meets it: messages, sums and exit codes.

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/support/shared_data.h"

namespace {

using imuscope::test::program_path;
using imuscope::test::scratch_folder;
using imuscope::test::shared_path;
using imuscope::test::source_path;
using nlohmann::json;

struct Outcome {
  int exit_code = -1;
  std::vector<json> lines;
  std::string err;
};

/// What the program prints goes into the folder, too.
Outcome decode_in(const std::filesystem::path& folder, const std::filesystem::path& file,
                  const std::string& options) {
  const auto out = folder / "stdout.txt";
  const auto err = folder / "stderr.txt";
  const std::string command = "'" + program_path("imuscope").string() + "' decode '" + file.string() + "' " +
                              options + " >'" + out.string() + "' 2>'" + err.string() + "'";
  const int status = std::system(command.c_str());
  Outcome outcome;
  outcome.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  std::ifstream lines(out);
  for (std::string line; std::getline(lines, line);) outcome.lines.push_back(json::parse(line));
  std::ifstream errors(err);
  outcome.err.assign(std::istreambuf_iterator<char>(errors), {});
  return outcome;
}

Outcome decode(const std::filesystem::path& file, const std::string& options) {
  return decode_in(scratch_folder(), file, options);
}

/// The named vector's bytes as a recording, decoded.
Outcome decode_vector(const std::string& protocol, const std::string& name) {
  std::ifstream in(source_path("tests/vectors/" + protocol + ".hex"));
  const auto folder = scratch_folder();
  const auto file = folder / (name + ".bin");
  for (std::string line; std::getline(in, line);) {
    if (line.rfind(name + ": ", 0) != 0) continue;
    std::ofstream out(file, std::ios::binary);
    for (std::size_t i = name.size() + 2; i + 1 < line.size(); i += 2) {
      out.put(static_cast<char>(std::stoi(line.substr(i, 2), nullptr, 16)));
    }
  }
  return decode_in(folder, file, "--json");
}

TEST(DecodeCommand, NamesTheFieldsOfMtDataAsTheVectorsDo) {
  const json oracle = json::parse(std::ifstream(source_path("tests/vectors/xsens_mtdata.json")));
  int checked = 0;
  for (const json& v : oracle["vectors"]) {
    const auto name = v["name"].get<std::string>();
    if (!v.contains("expected") || v["expected"].contains("counters") || name.rfind("corner_", 0) == 0)
      continue;
    SCOPED_TRACE(name);
    const Outcome outcome = decode_vector("xsens_mtdata", name);
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
    ASSERT_EQ(outcome.lines.size(), 2U);
    EXPECT_EQ(outcome.lines[0]["protocol"], "xsens_mt");
    EXPECT_EQ(outcome.lines[0]["offset"], 0);
    for (const auto& [key, value] : v["expected"].items()) EXPECT_EQ(outcome.lines[0][key], value) << key;
    EXPECT_EQ(outcome.lines[1], (json{{"messages", 1}, {"bytes_skipped", 0}}));
    ++checked;
  }
  EXPECT_EQ(checked, 22);
}

TEST(DecodeCommand, ListsTheItemsOfMtData2AsTheVectorsDo) {
  const json oracle = json::parse(std::ifstream(source_path("tests/vectors/xsens_mtdata2.json")));
  int checked = 0;
  for (const json& v : oracle["vectors"]) {
    if (!v.contains("expected")) continue;
    const Outcome outcome = decode_vector("xsens_mtdata2", v["name"]);
    ASSERT_EQ(outcome.lines.size(), 2U);
    EXPECT_EQ(outcome.lines[0]["items"], v["expected"]) << v["name"];
    ++checked;
  }
  EXPECT_EQ(checked, 7);
}

TEST(DecodeCommand, LosesNoMessageOfTheMtRecordings) {
  for (int i = 1; i <= 4; ++i) {
    const std::string file = "data/streams/xsens_mtdata2/" + std::to_string(i) + ".bin";
    IMUSCOPE_NEEDS_SHARED(file);
    const Outcome outcome = decode(shared_path(file), "--json");
    ASSERT_EQ(outcome.lines.size(), 101U);
    EXPECT_EQ(outcome.lines.back(), (json{{"messages", 100}, {"bytes_skipped", 0}}));
  }
}

/// Every key that is expected is there, with its value to the last bit or, where the vector rounds, to 1e-12
/// of it.
void expect_fields(const json& line, const json& expected) {
  for (const auto& [key, value] : expected.items()) {
    ASSERT_TRUE(line.contains(key) || value.is_null()) << key << " in " << line;
    if (value.is_number_float()) {
      EXPECT_NEAR(line[key].get<double>(), value.get<double>(), 1e-12 * (1.0 + std::abs(value.get<double>())))
          << key;
    } else if (value == "NaN") {
      EXPECT_TRUE(line[key].is_null()) << key;
    } else if (!value.is_null()) {
      EXPECT_EQ(line[key], value) << key;
    }
  }
}

json oracle_of(const std::string& name) {
  return json::parse(std::ifstream(source_path("tests/vectors/" + name + ".json")));
}

TEST(DecodeCommand, NamesTheBlocksOfStdBinAsTheVectorsDo) {
  int checked = 0;
  const json oracle = oracle_of("ixblue_stdbin");
  for (const json& v : oracle["vectors"]) {
    if (!v.contains("expected")) continue;
    SCOPED_TRACE(v["name"].get<std::string>());
    const Outcome outcome = decode_vector("ixblue_stdbin", v["name"]);
    ASSERT_EQ(outcome.lines.size(), 2U) << outcome.err;
    EXPECT_EQ(outcome.lines[0]["protocol"], "ixblue_stdbin");
    for (const auto& [key, value] : v["expected"].items()) EXPECT_EQ(outcome.lines[0][key], value) << key;
    ++checked;
  }
  EXPECT_EQ(checked, 25);
}

TEST(DecodeCommand, NamesTheFieldsOfGreisAsTheVectorsDo) {
  int checked = 0;
  const json oracle = oracle_of("greis");
  for (const json& v : oracle["vectors"]) {
    if (!v.contains("fields")) continue;
    SCOPED_TRACE(v["name"].get<std::string>());
    const Outcome outcome = decode_vector("greis", v["name"]);
    ASSERT_EQ(outcome.lines.size(), 2U) << outcome.err;
    EXPECT_EQ(outcome.lines[0]["protocol"], "greis");
    EXPECT_EQ(outcome.lines[0]["message"], v["id"]);
    EXPECT_EQ(outcome.lines[0]["checksum"], v["checksum"]);
    expect_fields(outcome.lines[0], v["fields"]);
    ++checked;
  }
  EXPECT_EQ(checked, 17);
}

TEST(DecodeCommand, NamesTheFieldsOfNavPvtAsTheVectorsDo) {
  int checked = 0;
  const json oracle = oracle_of("ubx_nav_pvt");
  for (const json& v : oracle["vectors"]) {
    if (!v.contains("fields")) continue;
    const Outcome outcome = decode_vector("ubx_nav_pvt", v["name"]);
    ASSERT_EQ(outcome.lines.size(), 2U) << outcome.err;
    EXPECT_EQ(outcome.lines[0]["protocol"], "ubx");
    EXPECT_EQ(outcome.lines[0]["message"], "NAV-PVT");
    for (const auto& [key, value] : outcome.lines[0].items()) {
      if (v["fields"].contains(key)) {
        EXPECT_EQ(value, v["fields"][key]) << key;
      }
    }
    for (const char* key : {"itow", "nano", "lat", "lon", "h", "vn", "ve", "vd", "flags", "sacc"}) {
      EXPECT_TRUE(outcome.lines[0].contains(key)) << key;
    }
    ++checked;
  }
  EXPECT_EQ(checked, 2);
}

TEST(DecodeCommand, NamesTheFieldsOfNmeaAsTheVectorsDo) {
  int checked = 0;
  const json oracle = oracle_of("nmea");
  for (const json& v : oracle["vectors"]) {
    if (!v.contains("expected")) continue;
    SCOPED_TRACE(v["name"].get<std::string>());
    const Outcome outcome = decode_vector("nmea", v["name"]);
    ASSERT_EQ(outcome.lines.size(), 2U) << outcome.err;
    EXPECT_EQ(outcome.lines[0]["protocol"], "nmea");
    expect_fields(outcome.lines[0], v["expected"]);
    EXPECT_EQ(outcome.lines[1], (json{{"messages", 1}, {"bytes_skipped", 0}}));
    ++checked;
  }
  EXPECT_EQ(checked, 13);
}

TEST(DecodeCommand, ReadsThePhinsStandardGroupOfOlderUnits) {
  const json sentences = oracle_of("phins_standard")["sentences"];
  const Outcome outcome = decode(source_path("tests/vectors/phins_standard.nmea"), "--json");
  ASSERT_EQ(outcome.lines.size(), sentences.size() + 1) << outcome.err;
  for (std::size_t i = 0; i < sentences.size(); ++i) {
    EXPECT_EQ(outcome.lines[i]["sentence"], sentences[i]["sentence"]);
    expect_fields(outcome.lines[i], sentences[i]["expected"]);
  }
  EXPECT_EQ(outcome.lines.back(), (json{{"messages", 9}, {"bytes_skipped", 0}}));
}

TEST(DecodeCommand, NamesTheColumnsOfRtklibAsTheVectorsDo) {
  const json files = oracle_of("rtklib_pos")["files"];
  for (const auto& [name, file] : files.items()) {
    SCOPED_TRACE(name);
    const Outcome outcome = decode(source_path("tests/vectors/" + name), "--json");
    ASSERT_FALSE(outcome.lines.empty()) << outcome.err;
    EXPECT_EQ(outcome.lines.back()["bytes_skipped"], 0);
    std::size_t row = 0;
    for (const json& line : outcome.lines) {
      if (line.value("message", "") != "solution") continue;
      ASSERT_LT(row, file["rows"].size());
      EXPECT_EQ(line["protocol"], "rtklib_pos");
      expect_fields(line, file["rows"][row++]);
    }
    EXPECT_EQ(row, file["rows"].size());
  }
}

/// Messages, by name, and the sums of a recording of `streams`, decoded without naming its protocol.
struct Counted {
  std::map<std::string, int> messages;
  json sums;
};
Counted count(const std::string& file) {
  Counted counted;
  const Outcome outcome = decode(shared_path(file), "--json");
  for (const json& line : outcome.lines) {
    if (line.contains("bytes_skipped")) {
      counted.sums = line;
    } else {
      ++counted.messages[line["protocol"].get<std::string>() + " " + line["message"].get<std::string>()];
    }
  }
  return counted;
}

TEST(DecodeCommand, FindsTheKnownCountsInTheRecordedStreams) {
  IMUSCOPE_NEEDS_SHARED("data/streams");
  const auto v3 = count("data/streams/ixblue_stdbin/v3.bin");
  EXPECT_EQ(v3.messages.at("ixblue_stdbin telegram"), 17);
  EXPECT_EQ(v3.sums, (json{{"messages", 17}, {"bytes_skipped", 0}}));
  for (const char* version : {"v2", "v3_old", "v4", "v5"}) {
    EXPECT_EQ(count(std::string("data/streams/ixblue_stdbin/") + version + ".bin").sums,
              (json{{"messages", 1}, {"bytes_skipped", 0}}));
  }
  const auto drive = count("data/streams/nmea/drive.nmea");
  EXPECT_EQ(drive.messages.at("nmea GGA"), 3634);
  EXPECT_EQ(drive.messages.at("nmea RMC"), 3634);
  EXPECT_EQ(drive.sums["bytes_skipped"], 0);
  const auto walk = count("data/streams/ubx/walk.ubx");
  EXPECT_EQ(walk.messages.at("ubx NAV-PVT"), 536);
  EXPECT_EQ(walk.sums, (json{{"messages", 3400 + 2010}, {"bytes_skipped", 0}}));
}

// The file is cut inside its last epoch: what follows the last whole message is skipped.
TEST(DecodeCommand, FindsEveryEpochOfTheJavadLogAndNoBadByteBeforeItsCut) {
  IMUSCOPE_NEEDS_SHARED("data/streams/greis/javad.jps");
  const Outcome outcome = decode(shared_path("data/streams/greis/javad.jps"), "--json");
  int epochs = 0;
  std::uint64_t end = 0;
  for (std::size_t i = 0; i + 1 < outcome.lines.size(); ++i) {
    const json& line = outcome.lines[i];
    ASSERT_EQ(line["protocol"], "greis");
    epochs += line["message"] == "~~" ? 1 : 0;
    end = line["offset"].get<std::uint64_t>();
  }
  EXPECT_EQ(epochs, 130);
  const auto file_size = std::filesystem::file_size(shared_path("data/streams/greis/javad.jps"));
  EXPECT_LT(outcome.lines.back()["bytes_skipped"].get<std::uint64_t>(), file_size - end);
}

TEST(DecodeCommand, SaysWhatIsWrongAndWithWhichExitCode) {
  const auto folder = scratch_folder();
  const Outcome missing = decode_in(folder, folder / "no_such_file.bin", "");
  EXPECT_EQ(missing.exit_code, 1);
  EXPECT_NE(missing.err.find("no_such_file.bin cannot be read"), std::string::npos) << missing.err;
  std::ofstream(folder / "empty.bin").close();
  const Outcome empty = decode_in(folder, folder / "empty.bin", "");
  EXPECT_EQ(empty.exit_code, 1);
  EXPECT_NE(empty.err.find("no message of a known protocol"), std::string::npos) << empty.err;
  const Outcome wrong = decode_in(folder, folder / "empty.bin", "--protocol morse");
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_NE(wrong.err.find("choose one of: "), std::string::npos) << wrong.err;
}

TEST(DecodeCommand, ShowsEverySignalOfTheCanVectorsBitForBit) {
  for (const std::string name : {"odometry", "xsens"}) {
    const std::string vectors = "tests/vectors/can_" + name;
    const auto dbc = source_path("tests/vectors/" + name + (name == "xsens" ? "_can.dbc" : ".dbc"));
    const json oracle = json::parse(std::ifstream(source_path(vectors + ".json")));
    const Outcome outcome = decode(source_path(vectors + ".candump"), "--dbc '" + dbc.string() + "' --json");
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
    ASSERT_EQ(outcome.lines.size(), oracle["vectors"].size() + 1);
    for (std::size_t i = 0; i < oracle["vectors"].size(); ++i) {
      const json& expected = oracle["vectors"][i];
      const json& line = outcome.lines[i];
      SCOPED_TRACE(expected["line"].get<std::string>());
      EXPECT_EQ(line["protocol"], "candump");
      for (const char* field : {"message", "time", "id", "extended", "fd", "signals"})
        EXPECT_EQ(line[field], expected[field]) << field;
    }
    EXPECT_EQ(outcome.lines.back(), (json{{"messages", oracle["vectors"].size()}, {"bytes_skipped", 0}}));
  }
}

TEST(DecodeCommand, FindsACanLogByItselfAndShowsItsFrames) {
  const auto folder = scratch_folder();
  const auto file = folder / "short.log";
  std::ofstream(file)
      << "(1.000001) can0 123#0102\n(1.000002) can0 18FF0100##1AABBCC\n(1.000003) can1 7FF#R5\n"
         "(1.000004) can0 20000040#0000000000000000\nnonsense\n";
  const Outcome outcome = decode_in(folder, file, "--json");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  ASSERT_EQ(outcome.lines.size(), 5U);
  EXPECT_EQ(outcome.lines[0]["message"], "123");
  EXPECT_EQ(outcome.lines[0]["data"], "0102");
  EXPECT_EQ(outcome.lines[1]["message"], "18FF0100");
  EXPECT_EQ(outcome.lines[1]["fd"], true);
  EXPECT_EQ(outcome.lines[2]["message"], "remote 7FF");
  EXPECT_EQ(outcome.lines[3]["message"], "error frame");
  EXPECT_EQ(outcome.lines[3]["error"], "bus-off");
  EXPECT_EQ(outcome.lines[4], (json{{"messages", 4}, {"bytes_skipped", 9}}));
}

TEST(DecodeCommand, ABrokenDbcFileIsRefusedWithItsLine) {
  const auto folder = scratch_folder();
  const auto log = folder / "frame.log";
  const auto dbc = folder / "broken.dbc";
  std::ofstream(log) << "(1.000001) can0 123#0102\n";
  std::ofstream(dbc) << "BO_ 1 A: 8 X\n SG_ S : 0,8@1+ (1,0) [0|0] \"\" X\n";
  const Outcome outcome = decode_in(folder, log, "--dbc '" + dbc.string() + "'");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_NE(outcome.err.find("broken.dbc:2: SG_ S: expected '|', found ','"), std::string::npos)
      << outcome.err;
}

}  // namespace
