/// Short forms of the programs that hold the noise models against their goals. Seeds are fixed: a program
/// that passes once passes always, until the numbers change.

#include <gtest/gtest.h>
#include <algorithm>
#include <fstream>
#include <string>

#include "programs.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

TEST(NoiseGoals, SelectionIntervalsMissingSamplesSpikesReplicatesAndComparisonsHoldInAFewSeries) {
  const auto folder = scratch_folder();
  const auto results = folder / "results";
  const auto run = [&] {
    return run_program("noise_goals", {"--series", "4", "--lengths", "14", "--results", results.string()},
                       folder / "log");
  };
  EXPECT_EQ(run(), 0) << read_text(folder / "log");
  const auto kept = read_text(results);
  EXPECT_GT(std::count(kept.begin(), kept.end(), '\n'), 60) << "a line a cell";
  EXPECT_EQ(run(), 0) << read_text(folder / "log");
  EXPECT_EQ(read_text(results), kept) << "what was done is not done again";
}

TEST(NoiseGoals, ACountBeyondItsBandIsMissedAndANameThatNoCellHasIsNoGoalMet) {
  const auto folder = scratch_folder();
  const auto results = folder / "results";
  const auto run = [&](const std::string& cells) {
    return run_program("noise_goals", {"--series", "100", "--only", cells, "--results", results.string()},
                       folder / "log");
  };
  std::ofstream(results) << "comparison/WN 0 100 differ 5 100\ncomparison/WN+RW 0 100 differ 30 100\n"
                         << "comparison/WN+GM 0 100 differ 5 100\ncomparison/WN+GM+RW 0 100 differ 5 100\n"
                         << "comparison/WN+2*GM 0 100 differ 5 100\ncomparison/WN+3*GM 0 100 differ 5 100\n";
  EXPECT_EQ(run("comparison"), 1);
  EXPECT_NE(read_text(folder / "log").find("MISSED"), std::string::npos);
  EXPECT_EQ(run("comparison/WN+2"), 0) << read_text(folder / "log");
  EXPECT_EQ(run("comparisons"), 1);
}

TEST(NoiseGoals, ExportedNumbersHoldTheTruth) {
  const auto folder = scratch_folder();
  EXPECT_EQ(run_program("export_coverage", {"--runs", "15"}, folder / "log"), 0) << read_text(folder / "log");
}

TEST(NoiseGoals, WhiteNoiseOfBothRegimesHoldsThroughDeviceBytes) {
  const auto folder = scratch_folder();
  EXPECT_EQ(run_program("noise_through_bytes",
                        {"--drives", "1", "--minutes", "6", "--config",
                         source_path("config/demo.toml").string(), "--folder", folder.string()},
                        folder / "log"),
            0)
      << read_text(folder / "log");
}

}  // namespace
}  // namespace imuscope::test
