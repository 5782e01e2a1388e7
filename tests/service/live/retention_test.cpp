/// Which runs go, and above all which stay.

#include "service/live/retention.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>
#include <chrono>
#include <filesystem>
#include <fstream>

#include "capture/recorder.h"
#include "rt/host_clock.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

using std::chrono::hours;
using testing::ElementsAre;
using testing::IsEmpty;

class RetentionTest : public testing::Test {
 protected:
  void SetUp() override { folder_ = test::scratch_folder(); }

  /// A run that ended so long ago.
  std::filesystem::path make_run(const std::string& name, hours age) const {
    const auto run = folder_ / name;
    std::filesystem::create_directory(run);
    RunHeader header;
    header.name = "car";
    header.period = std::chrono::milliseconds(10);
    auto recorder = Recorder::start({run / "capture.lcm", "IMUSCOPE", header}, {}, {});
    EXPECT_TRUE(recorder);
    EXPECT_TRUE((*recorder)->stop());
    for (const char* file :
         {"navigation.csv", "errors_mtx1.csv", "calibration.json", "run.json", "capture_001.lcm"})
      std::ofstream(run / file) << "text\n";
    for (const auto& entry : std::filesystem::directory_iterator(run))
      std::filesystem::last_write_time(entry.path(), std::filesystem::file_time_type::clock::now() - age);
    return run;
  }
  [[nodiscard]] std::vector<std::string> removable() const {
    std::vector<std::string> names;
    for (const auto& run : removable_runs(folder_)) names.push_back(run.name);
    return names;
  }
  [[nodiscard]] bool exists(const std::string& name) const { return std::filesystem::exists(folder_ / name); }

  std::filesystem::path folder_;
};

TEST_F(RetentionTest, RunsGoOldestFirstWithAllTheirFiles) {
  make_run("new", hours(1));
  make_run("old", hours(72));
  make_run("older", hours(96));
  EXPECT_THAT(removable(), ElementsAre("older", "old", "new"));
  RecordOptions limits;
  limits.remove_older_than_s = 86400.0;
  apply_retention(folder_, limits);
  EXPECT_FALSE(exists("older"));
  EXPECT_FALSE(exists("old"));
  EXPECT_TRUE(exists("new"));
}

TEST_F(RetentionTest, WithoutLimitsNothingGoes) {
  make_run("old", hours(10000));
  apply_retention(folder_, {});
  EXPECT_TRUE(exists("old"));
}

TEST_F(RetentionTest, ByTheirSizeNoMoreGoThanMakeRoom) {
  constexpr std::size_t kBytes = 300'000;
  for (const auto& [name, age] : {std::pair{"old", 72}, std::pair{"newer", 48}, std::pair{"new", 24}}) {
    const auto file = make_run(name, hours(age)) / "capture_002.lcm";
    std::ofstream(file) << std::string(kBytes, 'x');
    std::filesystem::last_write_time(file, std::filesystem::file_time_type::clock::now() - hours(age));
  }
  for (const auto& run : removable_runs(folder_)) {
    EXPECT_GT(run.bytes, kBytes);
    EXPECT_LT(run.bytes, 2 * kBytes);
  }
  RecordOptions limits;
  limits.remove_beyond_bytes = 2.5 * kBytes;
  apply_retention(folder_, limits);
  EXPECT_THAT(removable(), ElementsAre("newer", "new"));
}

TEST_F(RetentionTest, AKeptRunStaysUntilTheMarkIsTakenAway) {
  const auto run = make_run("old", hours(72));
  ASSERT_TRUE(set_kept(run, true));
  EXPECT_THAT(removable(), IsEmpty());
  RecordOptions limits;
  limits.remove_older_than_s = 1.0;
  limits.remove_beyond_bytes = 1.0;
  limits.remove_below_free_bytes = 1e18;
  apply_retention(folder_, limits);
  EXPECT_TRUE(exists("old"));
  ASSERT_TRUE(set_kept(run, false));
  apply_retention(folder_, limits);
  EXPECT_FALSE(exists("old"));
  EXPECT_FALSE(set_kept(folder_ / "absent", true));
}

TEST_F(RetentionTest, ARunThatIsBeingRecordedStaysAlsoForAnotherProcess) {
  const auto run = make_run("under_way", hours(72));
  std::array<int, 2> told{};
  std::array<int, 2> asked{};
  ASSERT_EQ(pipe(told.data()), 0);
  ASSERT_EQ(pipe(asked.data()), 0);
  const pid_t child = fork();
  char byte = 0;
  if (child == 0) {
    const RunLock lock(run);
    _exit(write(told[1], "1", 1) == 1 && read(asked[0], &byte, 1) == 1 ? 0 : 1);
  }
  ASSERT_EQ(read(told[0], &byte, 1), 1);
  EXPECT_THAT(removable(), IsEmpty());
  ASSERT_EQ(write(asked[1], "1", 1), 1);
  int status = 0;
  waitpid(child, &status, 0);
  for (const int fd : {told[0], told[1], asked[0], asked[1]}) close(fd);
  EXPECT_THAT(removable(), ElementsAre("under_way"));
}

TEST_F(RetentionTest, WhatIsNoRunStays) {
  std::filesystem::create_directory(folder_ / "photographs");
  std::ofstream(folder_ / "photographs" / "capture.jpg") << "x";
  std::filesystem::create_directory(folder_ / "empty");
  std::filesystem::create_directory(folder_ / "forged");
  std::ofstream(folder_ / "forged" / "capture.lcm") << "no capture";
  std::ofstream(folder_ / "capture.lcm") << "a file";
  // Somebody's own things in a run: a study, a note, a link.
  std::filesystem::create_directory(make_run("studied", hours(72)) / "study");
  std::ofstream(make_run("noted", hours(72)) / "notes.txt") << "the good one";
  const auto elsewhere = test::scratch_folder() / "elsewhere";
  std::filesystem::create_directories(elsewhere);
  std::filesystem::create_symlink("/etc/passwd", make_run("linked", hours(72)) / "errors_x.csv");
  make_run("real", hours(72));
  std::filesystem::rename(folder_ / "real", elsewhere / "real");
  std::filesystem::create_directory_symlink(elsewhere / "real", folder_ / "link");
  EXPECT_THAT(removable(), IsEmpty());
  std::filesystem::remove_all(elsewhere);
}

TEST(RetentionLimits, SizeAndFreeSpaceTakeNoMoreThanTheyNeed) {
  constexpr std::uint64_t kGb = 1'000'000'000;
  const UtcTime now = wall_clock_now();
  const std::vector<RemovableRun> runs{
      {"a", now - hours(5), 3 * kGb}, {"b", now - hours(4), 3 * kGb}, {"c", now - hours(3), 3 * kGb}};
  const auto names = [&](const RecordOptions& limits, std::uint64_t all, std::uint64_t free) {
    std::string list;
    for (const auto& removal : runs_to_remove(runs, limits, now, all, free)) list += removal.run.name;
    return list;
  };
  RecordOptions limits;
  limits.remove_beyond_bytes = 5e9;
  EXPECT_EQ(names(limits, 9 * kGb, 0), "ab");
  EXPECT_EQ(names(limits, 5 * kGb, 0), "");
  EXPECT_EQ(names(limits, 100 * kGb, 0), "abc") << "kept ones are large: all that may go, and no more";
  limits = {};
  limits.remove_below_free_bytes = 4e9;
  EXPECT_EQ(names(limits, 9 * kGb, 2 * kGb), "a");
  EXPECT_EQ(names(limits, 9 * kGb, 4 * kGb), "");
  limits = {};
  limits.remove_older_than_s = 3.5 * 3600.0;
  EXPECT_EQ(names(limits, 9 * kGb, 0), "ab");
}

TEST(RetentionLimits, AClockThatWasNotSetMakesNothingOld) {
  const UtcTime ended = wall_clock_now();
  const std::vector<RemovableRun> runs{{"a", ended - hours(10000), 1}, {"b", ended, 1}};
  RecordOptions limits;
  limits.remove_older_than_s = 3600.0;
  EXPECT_EQ(runs_to_remove(runs, limits, ended + hours(2), 2, 2).size(), 2U);
  EXPECT_TRUE(runs_to_remove(runs, limits, ended - hours(24), 2, 2).empty()) << "the PC begins in the past";
}

}  // namespace
}  // namespace imuscope
