/// The whole of the alignment on recordings of real sensors: time offset by content, reference at the study
/// sample's time, coarse mounting. What is expected was published with the recordings.

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <cmath>
#include <fstream>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "base/units.h"
#include "estimation/alignment/coarse_mounting.h"
#include "estimation/alignment/cross_correlation.h"
#include "estimation/alignment/reference_window.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

struct Recording {
  std::vector<double> time_s;
  std::vector<Vector3d> omega;
  std::vector<Vector3d> f;
  std::vector<double> magnitude;
  [[nodiscard]] RateMagnitudeSeries view() const { return {time_s, magnitude}; }
};

Recording read(const std::filesystem::path& path, std::size_t time_column, std::size_t first_gyro_column) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  Recording out;
  while (std::getline(file, line)) {
    std::istringstream fields(line);
    std::string field;
    std::vector<double> v;
    while (std::getline(fields, field, ',')) v.push_back(std::stod(field));
    const std::size_t c = first_gyro_column;
    if (!out.time_s.empty() && v[time_column] <= out.time_s.back()) continue;
    out.time_s.push_back(v[time_column]);
    out.omega.emplace_back(v[c], v[c + 1], v[c + 2]);
    out.f.emplace_back(v[c + 3], v[c + 4], v[c + 5]);
    out.magnitude.push_back(out.omega.back().norm());
  }
  return out;
}

Matrix3d zyx_deg(double x, double y, double z) {
  return (Eigen::AngleAxisd(z * kRadPerDeg, Vector3d::UnitZ()) *
          Eigen::AngleAxisd(y * kRadPerDeg, Vector3d::UnitY()) *
          Eigen::AngleAxisd(x * kRadPerDeg, Vector3d::UnitX()))
      .toRotationMatrix();
}

/// Every study sample against the reference at its time.
MountingResult mounting_of(const Recording& reference, const Recording& study, double offset_s,
                           double period_s, CoarseMounting& out) {
  const auto window = std::make_unique<ReferenceWindow>(ReferenceWindowOptions{11, period_s});
  CoarseMountingEstimator estimator;
  std::size_t r = 0;
  for (std::size_t i = 0; i < study.time_s.size(); ++i) {
    const HostTime t{from_seconds(study.time_s[i] + offset_s)};
    ReferenceKinematics motion;
    ReferenceResult result = window->evaluate(t, motion);
    while (result == ReferenceResult::kTooNew && r < reference.time_s.size()) {
      Sample sample{};
      sample.kind = SampleKind::kImu;
      sample.time = HostTime{from_seconds(reference.time_s[r])};
      for (std::size_t k = 0; k < 3; ++k) {
        sample.imu.omega_radps[k] = reference.omega[r][static_cast<Eigen::Index>(k)];
        sample.imu.f_mps2[k] = reference.f[r][static_cast<Eigen::Index>(k)];
      }
      (void)window->push(sample);
      ++r;
      result = window->evaluate(t, motion);
    }
    if (result == ReferenceResult::kOk)
      estimator.add(motion.omega_radps, motion.f_mps2, study.omega[i], study.f[i]);
  }
  return estimator.solve(out);
}

TEST(Recordings, CarDrivesGiveTimeOffsetAndMountingWithoutAnyPrior) {
  IMUSCOPE_NEEDS_SHARED("data/car_drive");
  const Matrix3d C_b_s = zyx_deg(-1.93, 0.20, -93.63).transpose();  // published as study to reference
  for (const auto& [name, offset_s] :
       std::vector<std::pair<std::string, double>>{{"02", 0.253}, {"07", 0.035}, {"08", -0.075}}) {
    const auto folder = test::shared_path("data/car_drive/" + name);
    const Recording reference = read(folder / "reference_imu.csv", 0, 1);
    const Recording study = read(folder / "study_imu.csv", 1, 2);
    const Result<TimeOffset> offset = find_time_offset(reference.view(), study.view(), {30.0, false});
    ASSERT_TRUE(offset.has_value()) << name << ": " << offset.error().text();
    // The filter's prior of the time offset is 10 ms.
    EXPECT_NEAR(offset->offset_s, offset_s, 0.010) << name;
    CoarseMounting found;
    ASSERT_EQ(mounting_of(reference, study, offset->offset_s, 0.01, found), MountingResult::kOk) << name;
    const double error_deg = Eigen::AngleAxisd(found.C_b_s.transpose() * C_b_s).angle() * kDegPerRad;
    EXPECT_LT(error_deg, 2.0) << name;
    RecordProperty("mounting_error_deg_" + name, std::to_string(error_deg));
  }
}

TEST(Recordings, HandSwungPairsGiveTimeOffsetAndMountingWithoutAnyPrior) {
  IMUSCOPE_NEEDS_SHARED("data/xsens_pair");
  struct Pair {
    std::string name;
    Matrix3d C_a_b;
    double offset_s;
  };
  for (const Pair& pair :
       {Pair{"45_1", zyx_deg(-1.35, 1.60, -45.01), 0.0}, Pair{"45_2", zyx_deg(-1.32, 1.67, -44.98), 0.0},
        Pair{"90_1", zyx_deg(-2.11, 0.30, -90.08), 0.251}}) {
    const Recording a = read(test::shared_path("data/xsens_pair/" + pair.name + "_a.csv"), 0, 3);
    const Recording b = read(test::shared_path("data/xsens_pair/" + pair.name + "_b.csv"), 0, 3);
    const Result<TimeOffset> offset = find_time_offset(a.view(), b.view());
    ASSERT_TRUE(offset.has_value()) << pair.name << ": " << offset.error().text();
    EXPECT_NEAR(offset->offset_s, pair.offset_s, 0.010) << pair.name;
    CoarseMounting found;
    ASSERT_EQ(mounting_of(a, b, offset->offset_s, 0.01, found), MountingResult::kOk) << pair.name;
    const double error_deg = Eigen::AngleAxisd(found.C_b_s.transpose() * pair.C_a_b).angle() * kDegPerRad;
    EXPECT_LT(error_deg, 2.0) << pair.name << "\n" << found.C_b_s;
    RecordProperty("mounting_error_deg_" + pair.name, std::to_string(error_deg));
  }
}

}  // namespace
}  // namespace imuscope
