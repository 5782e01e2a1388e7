/// A study of a drive in the middle of which an S-IMU was turned on its mount, as CSV files through the
/// program.

#include <fmt/format.h>
#include <fmt/os.h>
#include <gtest/gtest.h>
#include <Eigen/Dense>
#include <fstream>
#include <sstream>

#include "base/units.h"
#include "estimation/navigation/so3.h"
#include "programs.h"
#include "tests/estimation/calibration/simulated_drive.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kDrive_s = 480.0;
constexpr double kRemount_s = 240.0;
/// Noticed within seconds, found anew within a minute of driving.
constexpr double kSettled_s = 60.0;
constexpr double kTolerance_rad = 0.3 * kRadPerDeg;

constexpr const char* kConfiguration = R"(
[run]
name = "remount"
[[device]]
name = "reference"
role = "reference"
protocol = "csv_imu"
rate_hz = 100.0
[[device]]
name = "study"
role = "study"
protocol = "csv_imu"
rate_hz = 100.0
)";

void write_row(fmt::ostream& file, const Sample& sample) {
  const auto& w = sample.imu.omega_radps;
  const auto& f = sample.imu.f_mps2;
  file.print("{:.4f},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g}\n",
             to_seconds(sample.time.time_since_epoch()), w[0], w[1], w[2], f[0], f[1], f[2]);
}

/// The mounting of a row of smoothed_study.csv, whose quaternion begins at column `q_w`.
struct SmoothedRow {
  double time_s = 0.0;
  Matrix3d C_b_s;
};

std::vector<SmoothedRow> smoothed_rows(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  std::vector<std::string> columns;
  std::istringstream names(line);
  for (std::string name; std::getline(names, name, ',');) columns.push_back(name);
  const auto q_w =
      static_cast<std::size_t>(std::find(columns.begin(), columns.end(), "q_w") - columns.begin());
  std::vector<SmoothedRow> rows;
  while (std::getline(in, line)) {
    std::vector<double> values;
    std::istringstream cells(line);
    for (std::string cell; std::getline(cells, cell, ',');)
      values.push_back(std::strtod(cell.c_str(), nullptr));  // empty: no UTC
    const Eigen::Quaterniond q(values.at(q_w), values.at(q_w + 1), values.at(q_w + 2), values.at(q_w + 3));
    rows.push_back({values.front(), q.toRotationMatrix()});
  }
  return rows;
}

double angle_between(const Matrix3d& a, const Matrix3d& b) { return log_so3(a.transpose() * b).norm(); }

TEST(Remount, TheStudyKeepsToTheMountingThatWasInForceAtEachInstant) {
  const auto folder = scratch_folder();
  const Matrix3d before = exp_so3(Vector3d(0.1, 0.2, -1.5));
  const Matrix3d after = exp_so3(Vector3d(0.2, -0.3, 0.8)) * before;
  SimulatedDrive drive(kDrive_s, {{before, {0.35, -0.22, 0.12}, 0.0}}, 61);
  {
    auto reference = fmt::output_file((folder / "reference.csv").string());
    auto study = fmt::output_file((folder / "study.csv").string());
    for (fmt::ostream* file : {&reference, &study})
      file->print("t_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2\n");
    bool turned = false;
    while (!drive.done()) {
      if (!turned && drive.time_s() >= kRemount_s) {
        drive.remount(0, after);
        turned = true;
      }
      for (const Sample& sample : drive.next()) {
        if (sample.device == SimulatedDrive::kReference) write_row(reference, sample);
        if (sample.device == SimulatedDrive::kFirstStudy) write_row(study, sample);
      }
    }
  }
  std::ofstream(folder / "config.toml") << kConfiguration;
  const auto out = folder / "run";
  ASSERT_EQ(run_program("imuscope",
                        {"process", "reference=" + (folder / "reference.csv").string(),
                         "study=" + (folder / "study.csv").string(), "--config",
                         (folder / "config.toml").string(), "--out", out.string()},
                        folder / "log"),
            0)
      << read_text(folder / "log");

  const auto calibration = read_json(out / "calibration.json").at("imus").at(0);
  const auto C = calibration.at("C_b_s").get<std::array<double, 9>>();
  const Matrix3d found = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(C.data());
  EXPECT_LT(angle_between(found, after), kTolerance_rad);

  std::size_t early = 0;
  std::size_t late = 0;
  for (const SmoothedRow& row : smoothed_rows(out / "smoothed_study.csv")) {
    if (row.time_s < kRemount_s) {
      ++early;
      ASSERT_LT(angle_between(row.C_b_s, before), kTolerance_rad) << "at " << row.time_s << " s";
    } else if (row.time_s > kRemount_s + kSettled_s) {
      ++late;
      ASSERT_LT(angle_between(row.C_b_s, after), kTolerance_rad) << "at " << row.time_s << " s";
    }
  }
  // From the first samples on, five times a second.
  EXPECT_GT(early, static_cast<std::size_t>(4.5 * kRemount_s));
  EXPECT_GT(late, static_cast<std::size_t>(4.5 * (kDrive_s - kRemount_s - kSettled_s)));

  bool told = false;
  const auto run = read_json(out / "run.json");
  for (const auto& warning : run.at("warnings"))
    told = told || warning.get<std::string>().find("sit differently") != std::string::npos;
  EXPECT_TRUE(told);
  // No row of the error process may take the old mounting for the new one.
  std::ifstream errors(out / "errors_study.csv");
  std::string line;
  std::getline(errors, line);
  ASSERT_TRUE(std::getline(errors, line));
  EXPECT_GT(std::stod(line), kRemount_s - 1.0);
}

}  // namespace
}  // namespace imuscope::test
