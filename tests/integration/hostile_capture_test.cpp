/// A capture from somebody else may say anything: what is replayed from it stays in the folder that was asked
/// for.

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <algorithm>
#include <fstream>
#include <functional>
#include <imuscope/event_t.hpp>
#include <imuscope/exception_t.hpp>
#include <imuscope/raw_t.hpp>
#include <imuscope/run_t.hpp>
#include <lcm/lcm-cpp.hpp>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "capture/event_log_reader.h"
#include "programs.h"
#include "publish/message_codec.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

class HostileCapture : public testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::create_directories(home_);
    const std::string unpack = "gzip -dc " + source_path("tests/golden/capture.lcm.gz").string() + " > " +
                               (home_ / "golden.lcm").string();
    ASSERT_EQ(std::system(unpack.c_str()), 0);
  }

  /// A copy of the golden capture whose messages went through `change`.
  void forge(const std::function<void(LogEvent&)>& change) {
    auto reader = EventLogReader::open(home_ / "golden.lcm");
    ASSERT_TRUE(reader.has_value());
    lcm::LogFile forged((home_ / "forged.lcm").string(), "w");
    ASSERT_TRUE(forged.good());
    const auto write = [&](LogEvent& event) {
      lcm::LogEvent out;
      out.eventnum = event.number;
      out.timestamp = event.utime;
      out.channel = event.channel;
      out.datalen = static_cast<int>(event.data.size());
      out.data = event.data.data();
      ASSERT_EQ(forged.writeEvent(&out), 0);
    };
    LogEvent event;
    for (int n = 0; reader->next(event); ++n) {
      change(event);
      write(event);
      if (n == 0) std::for_each(added_.begin(), added_.end(), write);
    }
  }

  /// A message of a person in the forged capture, `after_s` after its begin.
  void add_message(double after_s, const std::string& text) {
    auto reader = EventLogReader::open(home_ / "golden.lcm");
    ASSERT_TRUE(reader.has_value());
    LogEvent first;
    ASSERT_TRUE(reader->next(first));
    event_t message;
    message.utime = first.utime + static_cast<std::int64_t>(after_s * 1e6);
    message.sequence = 0;
    message.source = "stranger";
    message.text = text;
    added_.push_back({0, message.utime, "IMUSCOPE_EVENT", encode_message(message)});
  }

  /// Rewrites the configuration that the capture carries.
  void forge_configuration(const std::function<void(std::string&)>& change) {
    forge([&](LogEvent& event) {
      auto run = decode_message<run_t>(event.data);
      if (!run) return;
      change(run->configuration);
      event.data = encode_message(*run);
    });
  }

  int replay() {
    return run_program("imuscope",
                       {"replay", (home_ / "forged.lcm").string(), "--out", (home_ / "out").string()},
                       home_ / "log");
  }

  int process() {
    return run_program("imuscope",
                       {"process", (home_ / "forged.lcm").string(), "--out", (home_ / "out").string()},
                       home_ / "log");
  }

  /// Everything in the scratch folder that is neither an input nor in the output folder.
  std::set<std::string> strays() {
    const std::set<std::string> known{"golden.lcm", "forged.lcm", "log", "out"};
    std::set<std::string> found;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(scratch_)) {
      const auto path = std::filesystem::relative(entry.path(), home_);
      if (!known.contains(path.begin()->string()) && !entry.is_directory()) found.insert(path.string());
    }
    return found;
  }

  static void replace_all(std::string& text, const std::string& from, const std::string& to) {
    ASSERT_NE(text.find(from), std::string::npos) << from;
    for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
      text.replace(at, from.size(), to);
  }

  std::vector<LogEvent> added_;  ///< after the first one
  std::filesystem::path scratch_ = scratch_folder();
  std::filesystem::path home_ = scratch_ / "one" / "two";
};

TEST_F(HostileCapture, WritesNowhereButIntoItsOutputFolder) {
  forge_configuration([&](std::string& text) {
    text = "record.folder = \"" + (scratch_ / "elsewhere").string() + "\"\n" + text;
  });
  ASSERT_EQ(replay(), 0) << read_text(home_ / "log");
  EXPECT_GT(std::filesystem::file_size(home_ / "out" / "errors_mtx1.csv"), 1000U);
  EXPECT_EQ(strays(), std::set<std::string>{});

  std::filesystem::remove_all(home_ / "out");
  forge_configuration([](std::string& text) { replace_all(text, "\"mtx1\"", "\"../../mtx1\""); });
  EXPECT_EQ(replay(), 2) << "a name that leads out of the folder";
  EXPECT_NE(read_text(home_ / "log").find("must be 1 to 32 letters"), std::string::npos)
      << read_text(home_ / "log");
  EXPECT_EQ(strays(), std::set<std::string>{});
}

TEST_F(HostileCapture, ADeviceThatTheConfigurationDoesNotNameBecomesNoFile) {
  forge([](LogEvent& event) {
    auto raw = decode_message<raw_t>(event.data);
    if (!raw || raw->device != "mtx1") return;
    raw->device = "../../mtx1";
    event.data = encode_message(*raw);
  });
  (void)replay();  // whether the reference alone is worth a run is not the question here
  EXPECT_EQ(strays(), std::set<std::string>{});
}

TEST_F(HostileCapture, AStampYearsAheadCostsWhatFollowsItOnThatDeviceAndNoTime) {
  std::int64_t reads = 0;
  constexpr std::int64_t kTenYears_ns = 10 * 365 * 86'400 * std::int64_t{1'000'000'000};
  forge([&](LogEvent& event) {
    auto raw = decode_message<raw_t>(event.data);
    if (!raw || raw->device != "mtx1" || ++reads != 200) return;
    raw->arrival_ns += kTenYears_ns;
    event.data = encode_message(*raw);
  });
  ASSERT_EQ(replay(), 0) << read_text(home_ / "log");
  const auto run = nlohmann::json::parse(read_text(home_ / "out" / "run.json"));
  for (const auto& device : run.at("devices")) {
    const auto problem = device.at("problem").get<std::string>();
    const bool is_told = problem.find("the next stamp lies more than 24 h ahead") != std::string::npos;
    EXPECT_EQ(is_told, device.at("name") == "mtx1") << device.at("name") << ": " << problem;
  }
}

TEST_F(HostileCapture, ARowOfRefusedSamplesOrSkippedTicksMayClaimAnyLength) {
  bool told = false;
  forge([&](LogEvent& event) {
    if (!decode_message<raw_t>(event.data) || std::exchange(told, true)) return;
    exception_t refused;
    refused.utime = event.utime;
    refused.sequence = 0;
    refused.kind = exception_t::REFUSED_SAMPLE;
    refused.device = "mtx1";
    refused.sample_sequence = 1'000'000'000;
    refused.tick = -1;
    refused.count = std::int64_t{1} << 61U;
    event.data = encode_message(refused);
  });
  ASSERT_EQ(replay(), 0) << read_text(home_ / "log");
}

TEST_F(HostileCapture, NothingThatARunLeavesIsWorldWritable) {
  forge([](LogEvent&) {});
  const mode_t before = ::umask(0);
  const int exit_code = replay();
  ::umask(before);
  ASSERT_EQ(exit_code, 0) << read_text(home_ / "log");
  std::size_t files = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(home_ / "out")) {
    ++files;
    EXPECT_EQ(entry.status().permissions() & std::filesystem::perms::others_write,
              std::filesystem::perms::none)
        << entry.path();
  }
  EXPECT_GT(files, 5U);
}

TEST_F(HostileCapture, MessagesOfAStrangerNameRegimesAndObeyNoTerminalNorStopAStudy) {
  add_message(1.0, "regime \xff\xfe\x1b]0;title\a\x1b[2J");
  add_message(8.0, "regime \u009b31mroad\n!touch started");
  for (int i = 0; i < 70; ++i) add_message(10.0 + 0.1 * i, "regime " + std::to_string(i));
  forge_configuration([](std::string& text) { text += "\n[regimes]\nby = \"labels\"\n"; });
  std::filesystem::rename(home_ / "forged.lcm", home_ / "forged\xff.lcm");
  ASSERT_EQ(run_program("imuscope",
                        {"process", (home_ / "forged\xff.lcm").string(), "--out", (home_ / "out").string()},
                        home_ / "log"),
            0)
      << read_text(home_ / "log");
  EXPECT_EQ(read_text(home_ / "log").find_first_of("\x1b\xff\a"), std::string::npos)
      << read_text(home_ / "log");
  const auto regimes = read_json(home_ / "out" / "regimes.json");
  EXPECT_EQ(regimes.at("regimes").at(0).at("name"), "???]0;title??[2J");
  EXPECT_EQ(regimes.at("regimes").at(1).at("name"), "?31mroad?!touch started");
  EXPECT_EQ(regimes.at("regimes").size(), 64U);

  // A folder that such a capture of an earlier version left.
  auto forged = read_text(home_ / "out" / "regimes.json");
  replace_all(forged, "???]0;title", "\\u001b]0;title");
  std::ofstream(home_ / "out" / "regimes.json") << forged;
  ASSERT_EQ(run_program("imuscope", {"tables", (home_ / "out").string()}, home_ / "log"), 0)
      << read_text(home_ / "log");
  EXPECT_NE(read_text(home_ / "log").find("?]0;title"), std::string::npos) << read_text(home_ / "log");
  EXPECT_EQ(read_text(home_ / "log").find('\x1b'), std::string::npos);
}

TEST_F(HostileCapture, ALinkInTheOutputFolderLeadsNoWriteOut) {
  forge([](LogEvent&) {});
  const auto victim = home_ / "log2";
  std::ofstream(victim) << "precious";
  const auto plant = [&](std::initializer_list<const char*> names) {
    std::filesystem::remove_all(home_ / "out");
    std::filesystem::create_directories(home_ / "out");
    for (const char* name : names) std::filesystem::create_symlink(victim, home_ / "out" / name);
  };
  plant({"navigation.csv", "calibration_mtx1.csv", "errors_mtx1.csv", "calibration.json", "models.json",
         "run.json"});
  ASSERT_EQ(replay(), 0) << read_text(home_ / "log");
  EXPECT_EQ(read_text(victim), "precious");
  plant({"navigation.csv", "errors_mtx1.csv", "run.json", ".error_rows", "smoothed_navigation.csv",
         "smoothed_mtx1.csv", "scatter_mtx1.csv", "regimes.json", "report.html", "models.json"});
  ASSERT_EQ(process(), 0) << read_text(home_ / "log");
  EXPECT_EQ(read_text(victim), "precious");
  for (const auto& entry : std::filesystem::directory_iterator(home_ / "out"))
    EXPECT_TRUE(entry.path().filename() == ".error_rows" || !entry.is_symlink()) << entry.path();
}

TEST_F(HostileCapture, PausesWithoutEndCostNeitherTimeNorDisk) {
  // From the 10th second on, every read comes 23 hours and 50 minutes behind the one before it.
  std::int64_t first_ns = 0;
  std::int64_t later_ns = 0;
  constexpr std::int64_t kPause_ns = (23 * 60 + 50) * std::int64_t{60'000'000'000};
  forge([&](LogEvent& event) {
    auto raw = decode_message<raw_t>(event.data);
    if (!raw) return;
    if (first_ns == 0) first_ns = raw->arrival_ns;
    if (raw->arrival_ns - first_ns > 10'000'000'000) later_ns += kPause_ns;
    raw->arrival_ns += later_ns;
    event.data = encode_message(*raw);
  });
  ASSERT_EQ(replay(), 0) << read_text(home_ / "log");
  const auto run = read_json(home_ / "out" / "run.json");
  EXPECT_NE(run.dump().find("these pauses were stepped over"), std::string::npos)
      << run.at("warnings").dump(1);
  EXPECT_NE(run.dump().find("the pauses are more than 24 h together"), std::string::npos)
      << run.at("devices").dump(1);
  std::uintmax_t size = 0;
  for (const auto& entry : std::filesystem::directory_iterator(home_ / "out")) size += entry.file_size();
  EXPECT_LT(size, 2 * std::filesystem::file_size(home_ / "forged.lcm"));
}

TEST_F(HostileCapture, APauseOfHoursIsSteppedOverAndWhatFollowsIsUsed) {
  constexpr std::int64_t kPause_ns = 5 * std::int64_t{3'600'000'000'000};
  std::int64_t first_ns = 0;
  forge([&](LogEvent& event) {
    auto raw = decode_message<raw_t>(event.data);
    if (!raw) return;
    if (first_ns == 0) first_ns = raw->arrival_ns;
    if (raw->arrival_ns - first_ns > 10'000'000'000) raw->arrival_ns += kPause_ns;
    event.data = encode_message(*raw);
  });
  ASSERT_EQ(replay(), 0) << read_text(home_ / "log");
  const auto run = read_json(home_ / "out" / "run.json");
  EXPECT_GT(run.at("duration_s").get<double>(), 5.0 * 3600.0) << "as a live run has it";
  EXPECT_NE(run.dump().find("1 times no device said anything for more than 2 minutes, 5.00 h"),
            std::string::npos)
      << run.at("warnings").dump(1);
  for (const auto& device : run.at("devices"))
    EXPECT_EQ(device.at("problem").get<std::string>().find("bytes are used"), std::string::npos)
        << device.dump(1);
}

TEST_F(HostileCapture, OneThatSaysThatEveryTickWasSkippedIsAnErrorOfTheStudy) {
  bool told = false;
  forge([&](LogEvent& event) {
    if (!decode_message<raw_t>(event.data) || std::exchange(told, true)) return;
    exception_t skipped;
    skipped.utime = event.utime;
    skipped.sequence = 0;
    skipped.kind = exception_t::SKIPPED_TICKS;
    skipped.sample_sequence = -1;
    skipped.tick = std::int64_t{1} << 61U;
    skipped.count = std::int64_t{1} << 61U;
    event.data = encode_message(skipped);
  });
  EXPECT_EQ(process(), 1) << read_text(home_ / "log");
  EXPECT_NE(read_text(home_ / "log").find("the estimator never came to a result"), std::string::npos)
      << read_text(home_ / "log");
  EXPECT_EQ(replay(), 0) << read_text(home_ / "log");
}

}  // namespace
}  // namespace imuscope::test
