/// What single blocks of the state are there for: drives that need them, with and without.

#include <gtest/gtest.h>
#include <array>
#include <cmath>

#include "base/units.h"
#include "estimation/calibration/estimator.h"
#include "estimation/navigation/so3.h"
#include "tests/estimation/calibration/simulated_drive.h"

namespace imuscope {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using test::SimulatedDrive;
using test::SimulatedStudy;

const Matrix3d kMounting = exp_so3(Vector3d(0.1, 0.2, -1.5));

double worst_boresight_in_sd(const SImuOutput& out, const Matrix3d& C_b_s) {
  const Vector3d psi = test::mounting_error_rad(out, C_b_s);
  double worst = 0.0;
  for (std::size_t i = 0; i < 3; ++i)
    worst = std::max(worst, std::abs(psi(static_cast<Eigen::Index>(i))) / out.sd_psi_rad[i]);
  return worst;
}

TEST(States, AMountThatCreepsIsFollowedWhereCreepIsAllowedAndLostWhereItIsNot) {
  constexpr double kDrive_s = 400.0;
  constexpr double kBegin_s = 150.0;
  constexpr int kStep_s = 10;
  const Vector3d step_rad(0.0, 0.0, 1.0 * kRadPerDeg * kStep_s / (kDrive_s - kBegin_s));
  std::array<double, 2> error_rad{};
  for (const bool allowed : {true, false}) {
    SimulatedDrive drive(kDrive_s, {{kMounting, {0.35, -0.22, 0.12}, 0.004}}, 71);
    EstimatorConfig config = drive.config();
    if (allowed) config.studies[0].boresight_creep_rad_per_sqrt_s = 0.02 * kRadPerDeg;
    Estimator estimator(config);
    Matrix3d C = kMounting;
    for (int tick = 0; !drive.done(); ++tick) {
      if (drive.time_s() > kBegin_s && tick % (kStep_s * static_cast<int>(SimulatedDrive::kRate_hz)) == 0) {
        C = C * exp_so3(-step_rad);
        drive.remount(0, C);
      }
      const std::vector<Sample> samples = drive.next();
      for (const Sample& sample : samples) estimator.add(sample);
      estimator.advance(samples.back().arrival);
    }
    ASSERT_GE(estimator.study(0).status, CalibrationStatus::kConverging);
    error_rad[allowed ? 0 : 1] = test::mounting_error_rad(estimator.study(0), C).norm();
    if (allowed) {
      EXPECT_LT(worst_boresight_in_sd(estimator.study(0), C), 4.0);
    }
  }
  EXPECT_LT(error_rad[0], 0.3 * kRadPerDeg);
  EXPECT_GT(error_rad[1], 2.0 * error_rad[0]);
}

/// 0.05 m/s^2 of bias pass for 0.3 deg of boresight, known to 0.6 mdeg.
TEST(States, ThePapersSixTakeBiasesForBoresightWithoutKnowingIt) {
  for (const bool paper : {true, false}) {
    SimulatedDrive drive(400.0, {{kMounting, {0.35, -0.22, 0.12}, 0.0}}, 72);
    EstimatorConfig config = drive.config();
    config.studies[0].prior_t_d_s = 0.0;
    if (paper) config.studies[0].blocks = kPaperSImuBlocks;
    Estimator estimator(config);
    while (!drive.done()) {
      const std::vector<Sample> samples = drive.next();
      for (const Sample& sample : samples) estimator.add(sample);
      estimator.advance(samples.back().arrival);
    }
    ASSERT_GE(estimator.study(0).status, CalibrationStatus::kConverging);
    const double worst = worst_boresight_in_sd(estimator.study(0), kMounting);
    if (paper) {
      EXPECT_GT(worst, 20.0);
      EXPECT_LT(std::max(estimator.study(0).sd_psi_rad[0], estimator.study(0).sd_psi_rad[1]),
                2e-3 * kRadPerDeg);
    } else {
      EXPECT_LT(worst, 4.0);
    }
  }
}

}  // namespace
}  // namespace imuscope
