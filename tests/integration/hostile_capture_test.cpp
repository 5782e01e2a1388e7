/// A capture from somebody else may say anything: what is replayed from it stays in the folder that was asked
/// for.

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <fstream>
#include <functional>
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
    LogEvent event;
    while (reader->next(event)) {
      change(event);
      lcm::LogEvent out;
      out.eventnum = event.number;
      out.timestamp = event.utime;
      out.channel = event.channel;
      out.datalen = static_cast<int>(event.data.size());
      out.data = event.data.data();
      ASSERT_EQ(forged.writeEvent(&out), 0);
    }
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

}  // namespace
}  // namespace imuscope::test
