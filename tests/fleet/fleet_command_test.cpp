/// `imuscope fleet` as a user meets it: a campaign of simulated captures, killed and resumed, and by its
/// command lines.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <set>
#include <sstream>
#include <string>
#include <thread>

#include "programs.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

using testing::HasSubstr;

/// Three drives of half a minute, one of them without a receiver, and a file that is no capture.
class FleetCommand : public testing::Test {
 protected:
  void SetUp() override {
    const std::string demo = read_text(source_path("config/demo.toml"));
    std::string no_gnss = demo;
    const auto gnss = no_gnss.rfind("[[device]]", no_gnss.find("name = \"gnss\""));
    no_gnss.erase(gnss, no_gnss.find("# Read by imusim alone") - gnss);
    record("van0/first", demo, 41);
    record("van0/second", demo, 42);
    record("van1/blind", no_gnss, 43);
    std::filesystem::create_directories(folder_ / "captures" / "van1");
    std::ofstream(folder_ / "captures" / "van1" / "damaged.lcm") << std::string(10000, 'x');
  }

  void record(const std::string& name, const std::string& configuration, int seed) {
    const auto config = folder_ / "config.toml";
    std::ofstream(config) << configuration;
    const auto drive = folder_ / "drive";
    ASSERT_EQ(run_program("imusim",
                          {"record", config.string(), "--minutes", "0.5", "--seed", std::to_string(seed),
                           "--out", drive.string()},
                          log_),
              0)
        << read_text(log_);
    std::filesystem::create_directories(folder_ / "captures" / name);
    std::filesystem::rename(drive / "capture.lcm", folder_ / "captures" / name / "capture.lcm");
    std::filesystem::remove_all(drive);
  }

  /// A campaign in a folder of its own.
  std::string fleet_file(const std::string& out) {
    const auto file = folder_ / (out + ".toml");
    std::ofstream toml(file);
    toml << fmt::format("[fleet]\nname = \"trial\"\ncaptures = [\"captures\"]\nout = \"{}\"\n", out);
    for (int van = 0; van < 2; ++van)
      toml << fmt::format(
          "[[mounting]]\nvehicle = \"van{0}\"\nname = \"spring\"\ncaptures = [\"van{0}/*\"]\nunits = {{ "
          "mtx1 = \"A{0}\", mtx2 = \"B{0}\", mtx3 = \"C{0}\" }}\n",
          van);
    return file.string();
  }

  /// All tables of results, one after the other.
  std::string results(const std::string& file) {
    const auto tables = folder_ / "tables";
    std::filesystem::remove_all(tables);
    EXPECT_EQ(run_program("imuscope", {"fleet", "export", file, "--csv", tables.string()}, log_), 0)
        << read_text(log_);
    std::string all;
    for (const auto& name :
         std::set<std::filesystem::path>(std::filesystem::directory_iterator(tables), {})) {
      const auto stem = name.stem();
      if (stem != "attempts" && stem != "other_results") all += stem.string() + "\n" + read_text(name);
    }
    return all;
  }

  std::string asked(const std::string& file, const std::string& sql) {
    EXPECT_EQ(run_program("imuscope", {"fleet", "query", file, sql}, log_), 0) << read_text(log_);
    return read_text(log_);
  }

  std::filesystem::path folder_ = scratch_folder();
  std::filesystem::path log_ = folder_ / "log";
};

TEST_F(FleetCommand, IsTheSameInOneGoKilledAndResumedAndByItsCommandLines) {
  const std::string whole = fleet_file("whole");
  ASSERT_EQ(run_program("imuscope", {"fleet", "run", whole}, log_), 0) << read_text(log_);
  EXPECT_THAT(read_text(log_), HasSubstr("3 of 4 captures studied, 1 refused; 6 of 6 units"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "whole" / "fleet.html"));
  const std::string expected = results(whole);
  EXPECT_GT(expected.size(), 100000U);
  EXPECT_THAT(asked(whole, "SELECT capture, state FROM without_study"),
              HasSubstr("van1/damaged.lcm  refused"));
  EXPECT_THAT(asked(whole, "SELECT capture, gnss_used FROM drives WHERE gnss_used IS NULL OR gnss_used = 0"),
              HasSubstr("van1/blind"));

  // Again: nothing is done twice.
  ASSERT_EQ(run_program("imuscope", {"fleet", "run", whole}, log_), 0) << read_text(log_);
  EXPECT_THAT(asked(whole, "SELECT count(*) AS n FROM attempts"), HasSubstr("\n4\n"));

  const std::string killed = fleet_file("killed");
  for (const int after_ms : {150, 700, 1500}) {
    BackgroundProgram run("imuscope", {"fleet", "run", killed, "--jobs", "2"}, log_);
    std::this_thread::sleep_for(std::chrono::milliseconds(after_ms));
    run.send(SIGKILL);
    (void)run.wait();
  }
  ASSERT_EQ(run_program("imuscope", {"fleet", "run", killed}, log_), 0) << read_text(log_);
  EXPECT_EQ(results(killed), expected);
  EXPECT_TRUE(std::filesystem::is_empty(folder_ / "killed" / "scratch"));

  const std::string by_lines = fleet_file("by_lines");
  ASSERT_EQ(run_program("imuscope", {"fleet", "tasks", by_lines}, log_), 0) << read_text(log_);
  std::istringstream lines(read_text(log_));
  int n = 0;
  for (std::string line; std::getline(lines, line); ++n) {
    const std::string command = "PATH=" + program_path("imuscope").parent_path().string() + ":$PATH " + line +
                                " >>" + log_.string() + " 2>&1";
    EXPECT_EQ(std::system(command.c_str()), 0) << line << read_text(log_);
  }
  EXPECT_EQ(n, 4 + 6);
  ASSERT_EQ(run_program("imuscope", {"fleet", "reduce", by_lines}, log_), 0) << read_text(log_);
  EXPECT_EQ(results(by_lines), expected);
}

TEST_F(FleetCommand, ThatIsInterruptedSaysHowToGoOn) {
  const std::string file = fleet_file("interrupted");
  BackgroundProgram run("imuscope", {"fleet", "run", file, "--jobs", "1"}, log_);
  const auto attempts = folder_ / "interrupted" / "attempts";
  for (int i = 0; i < 1000 && (!std::filesystem::exists(attempts) || std::filesystem::is_empty(attempts));
       ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  run.interrupt();
  EXPECT_EQ(run.wait(), 1);
  EXPECT_THAT(read_text(log_), HasSubstr("go on with imuscope fleet run"));
  EXPECT_EQ(run_program("imuscope", {"fleet", "status", file}, log_), 1);
  EXPECT_THAT(read_text(log_), HasSubstr("not yet studied"));
}

}  // namespace
}  // namespace imuscope::test
