#include "calibration/smoother.h"

#include <gtest/gtest.h>
#include <cmath>

#include "tests/calibration/simulated_drive.h"

namespace imuscope {
namespace {

using Eigen::Vector3d;
using test::SimulatedDrive;
using test::SimulatedStudy;

/// Keeps what the filter itself said at the epochs of the history.
class Recorder final : public HistorySink {
 public:
  void on_history(const HistoryEpoch& epoch) noexcept override {
    smoother.on_history(epoch);
    velocity.push_back(epoch.core.navigation().v_n_mps);
    sd_velocity.push_back(epoch.core.sd(kVelocityError));
  }
  Smoother smoother;
  std::vector<Vector3d> velocity;
  std::vector<double> sd_velocity;
};

TEST(Smoother, ImprovesOnTheFilterAndItsSdIsHonest) {
  const std::vector<SimulatedStudy> truth{{Eigen::Matrix3d::Identity(), {0.35, -0.22, 0.12}, 0.0}};
  SimulatedDrive drive(150.0, truth, 21);
  EstimatorConfig config = drive.config();
  StudyConfig& study = config.studies[0];
  study.blocks = kBiasStudyBlocks;
  study.prior_C_b_s = Matrix3{1, 0, 0, 0, 1, 0, 0, 0, 1};
  study.prior_t_d_s = 0.0;
  study.prior_r_bs_b_m = {0.35, -0.22, 0.12};
  Recorder recorder;
  Estimator estimator(config, &recorder);
  test::run(drive, estimator);

  const std::vector<SmoothedEpoch> smoothed = recorder.smoother.smooth();
  ASSERT_EQ(smoothed.size(), recorder.velocity.size());
  ASSERT_GT(smoothed.size(), 700U);
  // The end has no future to learn from.
  EXPECT_LT((smoothed.back().navigation.v_n_mps - recorder.velocity.back()).norm(), 1e-12);

  double filter_square = 0.0;
  double smoothed_square = 0.0;
  double normalised = 0.0;
  double n = 0.0;
  for (std::size_t k = 10; k + 10 < smoothed.size(); ++k) {
    const double t_s = static_cast<double>(to_ns(smoothed[k].time)) * 1e-9 - 10.0;
    const Vector3d v = drive.motion().state_at(t_s).v_n_mps;
    const Vector3d error = smoothed[k].navigation.v_n_mps - v;
    filter_square += (recorder.velocity[k] - v).squaredNorm();
    smoothed_square += error.squaredNorm();
    for (Eigen::Index i = 0; i < 3; ++i) normalised += std::pow(error(i) / smoothed[k].sd(3 + i), 2) / 3.0;
    n += 1.0;
    EXPECT_LE(smoothed[k].sd(3), recorder.sd_velocity[k] * (1.0 + 1e-6));
  }
  EXPECT_LT(smoothed_square, 0.5 * filter_square);
  // Smoothed errors stay correlated over tens of seconds: about ten independent values of three components.
  EXPECT_NEAR(normalised / n, 1.0, 0.9);
}

TEST(Smoother, FifteenMinutesOfThreeStudiesFitIntoSixtyFourMegabytes) {
  const std::vector<SimulatedStudy> truth(3);
  SimulatedDrive drive(100.0, truth, 22);
  EstimatorConfig config = drive.config();
  for (StudyConfig& study : config.studies) study.blocks = kBiasStudyBlocks;
  Smoother smoother;
  Estimator estimator(config, &smoother);
  test::run(drive, estimator, 10.0);
  const double per_epoch =
      static_cast<double>(smoother.memory_bytes()) / static_cast<double>(smoother.size());
  EXPECT_LT(per_epoch * 5.0 * 900.0, 64e6);
}

}  // namespace
}  // namespace imuscope
