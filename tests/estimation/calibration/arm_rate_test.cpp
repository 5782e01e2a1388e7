#include "estimation/calibration/arm_rate.h"

#include <gtest/gtest.h>
#include <cmath>
#include <random>

namespace imuscope {
namespace {

using Eigen::Vector3d;

constexpr double kRate_hz = 100.0;

TEST(ArmRate, QuietGyrosAreTakenAsTheyAre) {
  EXPECT_EQ(ArmRate(5e-4, kRate_hz).half_width(), 0U);
  EXPECT_EQ(ArmRate(5e-3, kRate_hz).half_width(), 3U);
  EXPECT_EQ(ArmRate(5e-3, 400.0).half_width(), 12U);
}

/// Least squares of an arm on rates that are noisy: the estimate gives the arm, the measured rate a shorter one.
TEST(ArmRate, AnArmComesOutAsLongAsItIs) {
  constexpr double kNoise_radps = 0.02;
  constexpr double kTurning_radps = 0.01;
  constexpr double kArm_m = 1.3;
  ArmRate rate(kNoise_radps, kRate_hz);
  const std::size_t n = 2 * rate.half_width() + 1;
  const double of_mean = kNoise_radps / std::sqrt(static_cast<double>(n));
  std::mt19937 random(3);
  std::normal_distribution<> normal;
  double xy = 0.0, xx = 0.0, raw_xy = 0.0, raw_xx = 0.0, left = 0.0;
  constexpr int kSamples = 200'000;
  int used = 0;
  for (int i = 0; i < kSamples; ++i) {
    const double truth = kTurning_radps * normal(random);
    const double mean = truth + of_mean * normal(random);
    rate.learn({mean, 0.0, 0.0});
    if (i < kSamples / 10) continue;
    const ArmRate::Estimate known = rate.estimate({mean, 0.0, 0.0}, n, true);
    const double swing_mps = truth * kArm_m;
    xy += known.omega_b_radps.x() * swing_mps;
    xx += known.omega_b_radps.x() * known.omega_b_radps.x();
    raw_xy += mean * swing_mps;
    raw_xx += mean * mean;
    const double off = truth - known.omega_b_radps.x();
    left += off * off;
    ++used;
    EXPECT_GE(known.share.minCoeff(), 0.0);
    EXPECT_LE(known.share.maxCoeff(), 1.0);
  }
  EXPECT_NEAR(xy / xx, kArm_m, 0.02 * kArm_m);
  const double attenuation = 1.0 / (1.0 + of_mean * of_mean / (kTurning_radps * kTurning_radps));
  EXPECT_NEAR(raw_xy / raw_xx, attenuation * kArm_m, 0.01 * kArm_m);
  EXPECT_LT(attenuation, 0.7);
  EXPECT_NEAR(rate.estimate(Vector3d::Zero(), n, true).sd_radps, std::sqrt(left / used), 0.02 * of_mean);
}

TEST(ArmRate, StandingNothingTurnsAndBeforeItIsLearntLittleIsBelieved) {
  ArmRate rate(0.02, kRate_hz);
  const ArmRate::Estimate standing = rate.estimate({0.01, 0.02, -0.01}, 7, false);
  EXPECT_EQ(standing.omega_b_radps, Vector3d::Zero());
  EXPECT_EQ(standing.sd_radps, 0.0);
  EXPECT_GT(rate.estimate({0.01, 0.02, -0.01}, 7, true).sd_radps, 0.1);
  for (int i = 0; i < 1000; ++i) rate.learn({0.1, 0.1, 0.1});
  EXPECT_LT(rate.estimate({0.01, 0.02, -0.01}, 7, true).sd_radps, 0.01);
}

}  // namespace
}  // namespace imuscope
