/// Run folders of several drives made into one mounting, as documents: what is right about the numbers, the tests of
/// combine() prove.

#include <gtest/gtest.h>
#include <unistd.h>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "estimation/calibration/filter_core.h"
#include "estimation/navigation/so3.h"
#include "study/combination.h"
#include "study/mountings.h"
#include "study/several_drives.h"
#include "study/temperature_track.h"
#include "tests/support/recorded_answer.h"

namespace imuscope {
namespace {

using nlohmann::json;

/// Folders of runs, gone at the end.
struct RunFolders {
  std::filesystem::path path =
      std::filesystem::temp_directory_path() / ("combination_" + std::to_string(::getpid()));
  RunFolders() { std::filesystem::create_directories(path); }
  RunFolders(const RunFolders&) = delete;
  RunFolders& operator=(const RunFolders&) = delete;
  ~RunFolders() { std::filesystem::remove_all(path); }

  [[nodiscard]] std::filesystem::path write(const std::string& name, const json& calibration,
                                            const json& run) const {
    std::filesystem::create_directories(path / name);
    std::ofstream(path / name / "calibration.json") << calibration.dump();
    std::ofstream(path / name / "run.json") << run.dump();
    return path / name;
  }
  [[nodiscard]] std::string without(std::string text) const {
    for (auto at = text.find(path.string()); at != std::string::npos; at = text.find(path.string()))
      text.erase(at, path.string().size());
    return text;
  }
};

json imu_of(const std::string& name, std::size_t drive, bool shares) {
  const double off = 1e-3 * std::sin(7.0 * static_cast<double>(drive) + static_cast<double>(name.back()));
  Eigen::Matrix<double, 6, 6> P = Eigen::Matrix<double, 6, 6>::Constant(1e-7);
  P.diagonal() << 1e-6, 2e-6, 3e-6, 1e-5, 2e-5, 3e-5;
  std::vector<double> covariance(P.data(), P.data() + 36);
  json imu{{"name", name},
           {"status", "calibrated"},
           {"C_b_s", to_array(Eigen::Matrix3d(exp_so3({0.3, -1.2 + off, 2.0})))},
           {"r_bs_b_m", {0.35, -0.22 + 3.0 * off, 0.12}},
           {"covariance_psi_r", covariance}};
  if (shares) imu["batch"]["shared_psi_r"] = std::vector<double>(12, 2e-4);
  return imu;
}

json calibration_of(std::size_t drive, bool shares = false) {
  return {{"schema", "imuscope.calibration/1"},
          {"imus", {imu_of("mtx1", drive, shares), imu_of("mtx2", drive, shares)}}};
}

json run_of(const std::string& input) {
  return {{"schema", "imuscope.run/1"}, {"inputs", {input, "b.csv", 7}}};
}

std::string combined(const RunFolders& folders, const std::vector<DriveMountings>& drives,
                     std::optional<CombineMethod> method = {}) {
  const auto found = combine_drives(drives, method);
  std::string text = folders.without(found ? combination_json(*found).dump() : found.error().text()) + "\n";
  // A key a line.
  for (auto at = text.find(",\""); at != std::string::npos; at = text.find(",\"", at + 2))
    text.insert(at + 1, 1, '\n');
  return text;
}

TEST(CombinationAnswers, Documents) {
  const RunFolders folders;
  std::string text;
  for (const bool shares : {false, true}) {
    std::vector<DriveMountings> drives;
    for (std::size_t i = 0; i < 3; ++i) {
      json calibration = calibration_of(i, shares);
      if (i == 1) calibration["imus"][1]["status"] = "coarse";
      json run = run_of("a" + std::to_string(i));
      run["inputs"] = {"a" + std::to_string(i)};
      const auto read = read_mountings(folders.write("run" + std::to_string(i), calibration, run));
      ASSERT_TRUE(read) << read.error().text();
      EXPECT_EQ(read->inputs.size(), 1U);
      EXPECT_EQ(read->studies.size(), i == 1 ? 1U : 2U);
      EXPECT_EQ(read->without_estimate.size(), i == 1 ? 1U : 0U);
      EXPECT_EQ(read->studies[0].estimate.shared_psi_r.size(), shares ? 12U : 0U);
      drives.push_back(*read);
    }
    text += combined(folders, drives);
    text += combined(folders, drives, CombineMethod::kCovarianceIntersection);
    drives[2].inputs = drives[0].inputs;
    text += combined(folders, drives);
    text += combined(folders, drives, CombineMethod::kInverseVariance);
    drives.resize(2);
    text += combined(folders, drives);
    drives.resize(1);
    text += combined(folders, drives);
    drives[0].studies[0].estimate.covariance_psi_r[0] = -1.0;
    drives.push_back(drives[0]);
    text += combined(folders, drives);
  }
  test::expect_recorded("study/combination.txt", text, 1e-5, 1e-10);
}

TEST(CombinationAnswers, RefusedFolders) {
  const RunFolders folders;
  std::string text;
  const auto refused = [&](const json& calibration, const json& run) {
    const auto read = read_mountings(folders.write("run", calibration, run));
    text += folders.without(read ? "taken" : read.error().text()) + "\n";
  };
  const json run = run_of("a.csv");
  refused(calibration_of(0), run);
  refused(calibration_of(0), json::object());
  refused(calibration_of(0), json::array());
  refused({{"schema", "imuscope.calibration/9"}}, run);
  refused({{"schema", "imuscope.calibration/1"}}, run);
  refused({{"schema", "imuscope.calibration/1"}, {"imus", {{{"status", "calibrated"}}}}}, run);
  const auto changed = [&](const auto& change) {
    json calibration = calibration_of(0, true);
    change(calibration["imus"][1]);
    refused(calibration, run);
  };
  changed([](json& imu) { imu["C_b_s"].erase(8); });
  changed([](json& imu) { imu["C_b_s"][0] = "x"; });
  changed([](json& imu) { imu["C_b_s"][0] = imu["C_b_s"][0].get<double>() + 1e-5; });
  changed([](json& imu) { imu["C_b_s"][0] = imu["C_b_s"][0].get<double>() + 1e-8; });
  changed([](json& imu) {
    for (json& c : imu["C_b_s"]) c = -c.get<double>();
  });
  changed([](json& imu) { imu.erase("r_bs_b_m"); });
  changed([](json& imu) { imu["covariance_psi_r"] = 3.0; });
  changed([](json& imu) { imu["batch"]["shared_psi_r"].erase(0); });
  changed([](json& imu) { imu["batch"]["shared_psi_r"] = std::vector<double>(6000, 0.0); });
  changed([](json& imu) { imu["batch"]["shared_psi_r"] = std::vector<double>(6006, 0.0); });
  changed([](json& imu) { imu["batch"] = 1; });
  changed([](json& imu) { imu["name"] = 1; });
  text += folders.without(read_mountings(folders.path / "nowhere").error().text()) + "\n";
  test::expect_recorded("study/refused_folders.txt", text);
}

TEST(CombinationAnswers, InputsOfSeveralDrives) {
  using Drives = std::vector<std::vector<std::string>>;
  EXPECT_EQ(drives_of({"a.lcm", "b.lcm"}), (Drives{{"a.lcm"}, {"b.lcm"}}));
  EXPECT_EQ(drives_of({"r=1.csv", "s=1.csv", "r=2.csv", "s=2.csv", "r=3.csv"}),
            (Drives{{"r=1.csv", "s=1.csv"}, {"r=2.csv", "s=2.csv"}, {"r=3.csv"}}));
  EXPECT_TRUE(drives_of({}).empty());
  EXPECT_EQ(drive_folder("out", 0), std::filesystem::path("out/drive1"));
  EXPECT_EQ(drive_folder("out", 9), std::filesystem::path("out/drive10"));
}

TEST(CombinationAnswers, MeanTemperatureIsThatOfTheWholeSecondsThatItTouches) {
  const auto at = [](double s) { return HostTime{from_seconds(s)}; };
  TemperatureTrack track;
  EXPECT_TRUE(track.empty());
  EXPECT_FALSE(track.mean(at(0.0), at(10.0)));
  track.add(at(1.2), 20.0);
  track.add(at(1.9), 22.0);
  track.add(at(2.0), 27.0);
  track.add(at(5.5), 40.0);
  EXPECT_FALSE(track.empty());
  EXPECT_NEAR(*track.mean(at(1.0), at(1.9)), 21.0, 1e-12);
  EXPECT_NEAR(*track.mean(at(1.0), at(2.0)), 23.0, 1e-12);
  EXPECT_NEAR(*track.mean(at(1.5), at(3.0)), 23.0, 1e-12);
  EXPECT_FALSE(track.mean(at(3.0), at(4.9)));
  EXPECT_NEAR(*track.mean(at(5.0), at(9.0)), 40.0, 1e-12);
}

}  // namespace
}  // namespace imuscope
