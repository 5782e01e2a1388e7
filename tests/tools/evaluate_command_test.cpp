/// `imuscope evaluate` on a recorded drive: which model predicts the errors of a real sensor.

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/support/shared_data.h"

namespace {

using imuscope::test::program_path;
using imuscope::test::scratch_folder;
using imuscope::test::shared_path;
using imuscope::test::source_path;
using nlohmann::json;

int run(const std::string& arguments) {
  const std::string command = "'" + program_path("imuscope").string() + "' " + arguments;
  const int status = std::system(command.c_str());
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

std::string quoted(const std::filesystem::path& path) { return "'" + path.string() + "'"; }

const json& row_of(const json& document, const std::string& model, double duration_s) {
  for (const auto& row : document.at("evaluations")) {
    if (row.at("model") == model && row.at("duration_s") == duration_s) return row;
  }
  throw std::runtime_error("no row of " + model);
}

TEST(EvaluateCommand, OnARecordedDriveTheFittedModelOfMotionPredictsWhatTheDataSheetDoesNot) {
  IMUSCOPE_NEEDS_SHARED("data/car_drive");
  const auto folder = scratch_folder();
  const auto drive = shared_path("data/car_drive/08");
  const auto out = folder / "run";
  ASSERT_EQ(run("process reference=" + quoted(drive / "reference_imu.csv") +
                " gnss=" + quoted(drive / "gnss.csv") + " dot=" + quoted(drive / "study_imu.csv") +
                " --config " + quoted(source_path("config/csv_drive.toml")) + " --out " + quoted(out) + " >" +
                quoted(folder / "process.txt") + " 2>&1"),
            0);
  ASSERT_EQ(run("evaluate " + quoted(out) + " --settle 30 --json >" + quoted(folder / "table.json") + " 2>" +
                quoted(folder / "evaluate.txt")),
            0);
  std::ifstream in(folder / "table.json");
  const json table = json::parse(in);
  const json& fitted = row_of(table, "dynamic", 10.0);
  const json& sheet = row_of(table, "data sheet", 10.0);
  EXPECT_GE(fitted.at("n_independent"), 5);
  // Of seven independent outages a right model's mean NEES lies between 0.3 and 2.1 but for one in a
  // thousand.
  EXPECT_GT(fitted.at("nees_position"), 0.3);
  EXPECT_LT(fitted.at("nees_position"), 2.1);
  EXPECT_GT(sheet.at("nees_position"), sheet.at("nees_high"));
  EXPECT_LT(fitted.at("surprise"), sheet.at("surprise"));
  EXPECT_TRUE(std::filesystem::exists(out / "evaluation.json"));
}

TEST(EvaluateCommand, AFolderThatNoStudyWroteIsRefusedInWords) {
  const auto folder = scratch_folder();
  EXPECT_EQ(run("evaluate " + quoted(folder) + " 2>" + quoted(folder / "empty.txt")), 1);
  std::ifstream in(folder / "empty.txt");
  std::string words;
  std::getline(in, words);
  EXPECT_NE(words.find("run.json"), std::string::npos) << words;
  EXPECT_NE(words.find("imuscope process"), std::string::npos) << words;
}

}  // namespace
