/// The short form of imuscope_time_goals: one drive a cell, and the same again from what was kept of it.

#include <gtest/gtest.h>
#include <algorithm>
#include <string>

#include "programs.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

TEST(TimeGoals, HoldOnOneDriveOfEachCellAndGoOnWhereTheyEnded) {
  const auto folder = scratch_folder();
  const auto results = folder / "results";
  const auto run = [&](const std::string& drives) {
    return run_program("imuscope_time_goals",
                       {"--cell", "quartz", "--cell", "pps", "--cell", "gnss", "--drives", drives,
                        "--minutes", "4", "--folder", folder.string(), "--results", results.string()},
                       folder / "log");
  };
  EXPECT_EQ(run("1"), 0) << read_text(folder / "log");
  const auto kept = read_text(results);
  EXPECT_EQ(std::count(kept.begin(), kept.end(), '\n'), 3) << kept;
  EXPECT_EQ(run("1"), 0) << read_text(folder / "log");
  EXPECT_EQ(read_text(results), kept) << "what was done is not done again";
}

}  // namespace
}  // namespace imuscope::test
