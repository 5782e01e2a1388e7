/// `imuscope decode` as a user meets it: messages, sums and exit codes.

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/support/shared_data.h"

namespace {

using imuscope::test::program_path;
using imuscope::test::scratch_folder;
using imuscope::test::shared_path;
using nlohmann::json;

struct Outcome {
  int exit_code = -1;
  std::vector<json> lines;
  std::string err;
};

Outcome decode(const std::filesystem::path& file, const std::string& options) {
  const auto folder = scratch_folder();
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

/// Writes the named vector's bytes as a recording.
std::filesystem::path recording_of(const std::string& protocol, const std::string& name) {
  std::ifstream in(shared_path("oracle/protocols/" + protocol + ".hex"));
  const auto file = std::filesystem::path(testing::TempDir()) / ("imuscope_" + name + ".bin");
  for (std::string line; std::getline(in, line);) {
    if (line.rfind(name + ": ", 0) != 0) continue;
    std::ofstream out(file, std::ios::binary);
    for (std::size_t i = name.size() + 2; i + 1 < line.size(); i += 2) {
      out.put(static_cast<char>(std::stoi(line.substr(i, 2), nullptr, 16)));
    }
  }
  return file;
}

TEST(DecodeCommand, NamesTheFieldsOfMtDataAsTheVectorsDo) {
  IMUSCOPE_NEEDS_SHARED("oracle/protocols/xsens_mtdata.json");
  const json oracle = json::parse(std::ifstream(shared_path("oracle/protocols/xsens_mtdata.json")));
  int checked = 0;
  for (const json& v : oracle["vectors"]) {
    const auto name = v["name"].get<std::string>();
    if (!v.contains("expected") || v["expected"].contains("counters") || name.rfind("corner_", 0) == 0)
      continue;
    SCOPED_TRACE(name);
    const Outcome outcome = decode(recording_of("xsens_mtdata", name), "--json");
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
  IMUSCOPE_NEEDS_SHARED("oracle/protocols/xsens_mtdata2.json");
  const json oracle = json::parse(std::ifstream(shared_path("oracle/protocols/xsens_mtdata2.json")));
  int checked = 0;
  for (const json& v : oracle["vectors"]) {
    if (!v.contains("expected")) continue;
    const Outcome outcome = decode(recording_of("xsens_mtdata2", v["name"]), "--json");
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

TEST(DecodeCommand, SaysWhatIsWrongAndWithWhichExitCode) {
  const auto folder = std::filesystem::path(testing::TempDir());
  const Outcome missing = decode(folder / "imuscope_no_such_file.bin", "");
  EXPECT_EQ(missing.exit_code, 1);
  EXPECT_NE(missing.err.find("imuscope_no_such_file.bin cannot be read"), std::string::npos) << missing.err;
  std::ofstream(folder / "imuscope_empty.bin").close();
  const Outcome empty = decode(folder / "imuscope_empty.bin", "");
  EXPECT_EQ(empty.exit_code, 1);
  EXPECT_NE(empty.err.find("no message of a known protocol"), std::string::npos) << empty.err;
  const Outcome wrong = decode(folder / "imuscope_empty.bin", "--protocol morse");
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_NE(wrong.err.find("choose one of: "), std::string::npos) << wrong.err;
}

TEST(DecodeCommand, ShowsEverySignalOfTheCanVectorsBitForBit) {
  for (const std::string name : {"odometry", "xsens"}) {
    const std::string vectors = "oracle/protocols/can_" + name;
    IMUSCOPE_NEEDS_SHARED(vectors + ".json");
    const auto dbc = shared_path("oracle/protocols/" + name + (name == "xsens" ? "_can.dbc" : ".dbc"));
    const json oracle = json::parse(std::ifstream(shared_path(vectors + ".json")));
    const Outcome outcome = decode(shared_path(vectors + ".candump"), "--dbc '" + dbc.string() + "' --json");
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
  const auto file = std::filesystem::path(testing::TempDir()) / "imuscope_short.log";
  std::ofstream(file)
      << "(1.000001) can0 123#0102\n(1.000002) can0 18FF0100##1AABBCC\n(1.000003) can1 7FF#R5\n"
         "(1.000004) can0 20000040#0000000000000000\nnonsense\n";
  const Outcome outcome = decode(file, "--json");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  ASSERT_EQ(outcome.lines.size(), 5U);
  EXPECT_EQ(outcome.lines[0]["message"], "123");
  EXPECT_EQ(outcome.lines[0]["data"], "0102");
  EXPECT_EQ(outcome.lines[1]["message"], "18FF0100");
  EXPECT_EQ(outcome.lines[1]["fd"], true);
  EXPECT_EQ(outcome.lines[2]["message"], "remote 7FF");
  EXPECT_EQ(outcome.lines[3]["message"], "error frame");
  EXPECT_EQ(outcome.lines[4], (json{{"messages", 4}, {"bytes_skipped", 9}}));
}

TEST(DecodeCommand, ABrokenDbcFileIsRefusedWithItsLine) {
  const auto log = std::filesystem::path(testing::TempDir()) / "imuscope_frame.log";
  const auto dbc = std::filesystem::path(testing::TempDir()) / "broken.dbc";
  std::ofstream(log) << "(1.000001) can0 123#0102\n";
  std::ofstream(dbc) << "BO_ 1 A: 8 X\n SG_ S : 0,8@1+ (1,0) [0|0] \"\" X\n";
  const Outcome outcome = decode(log, "--dbc '" + dbc.string() + "'");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_NE(outcome.err.find("broken.dbc:2: SG_ S: expected '|', found ','"), std::string::npos)
      << outcome.err;
}

}  // namespace
