#include "estimation/calibration/update_window.h"

#include <gtest/gtest.h>
#include <cmath>
#include <random>
#include <vector>

#include "base/units.h"
#include "sample/eigen_arrays.h"

namespace imuscope {
namespace {

using Eigen::Vector3d;

constexpr double kRate_hz = 100.0;
constexpr ReferenceWindowOptions kReference{5, 0.01};

Vector3d noise(std::mt19937_64& random, double sd) {
  std::normal_distribution<double> normal;
  const double x = normal(random);
  const double y = normal(random);
  return sd * Vector3d(x, y, normal(random));
}

TEST(UpdateWindow, NeighboursTogetherCountEverySampleOnce) {
  for (const int n : {1, 2, 5, 10, 50}) {
    double sum = 0.0;
    double squares = 0.0;
    for (int k = 0; k < n; ++k) {
      EXPECT_NEAR(window_weight(n, k) + window_weight(n, k + n), 1.0, 1e-15) << n;
      for (const int half : {k, k + n}) {
        sum += window_weight(n, half);
        squares += window_weight(n, half) * window_weight(n, half);
      }
    }
    EXPECT_NEAR(sum, n, 1e-12);
    EXPECT_NEAR(n * squares / (sum * sum), window_white_share(n), 1e-12) << n;
  }
}

TEST(UpdateWindow, NoiseGainsAreThoseOfSampledNoise) {
  for (const int n : {1, 10, 20}) {
    std::mt19937_64 random(31);
    const NoiseGains gains = noise_gains(kReference, kRate_hz, n);
    Vector3d value = Vector3d::Zero();
    Vector3d slope = Vector3d::Zero();
    Vector3d curvature = Vector3d::Zero();
    constexpr int kWindows = 3000;
    ReferenceWindow window(kReference);
    ReferenceMean mean;
    int used = 0;
    int position = 0;
    for (int k = 0; used < kWindows; ++k) {
      Sample sample{};
      sample.kind = SampleKind::kImu;
      sample.time = HostTime{} + from_seconds(0.01 * k);
      sample.imu.omega_radps = to_array(noise(random, 1.0));
      ASSERT_TRUE(window.push(sample));
      ReferenceKinematics b;
      // As if every S sample came 3 ms after one of the reference.
      if (window.evaluate(HostTime{} + from_seconds(0.01 * (k - 3) + 0.003), b) != ReferenceResult::kOk)
        continue;
      if (n > 1) {
        mean.add(window_weight(n, position) / n, b);
      } else {
        mean = b;
      }
      if (++position < 2 * n) continue;
      value += mean.omega_radps.cwiseAbs2();
      slope += mean.omega_dot_radps2.cwiseAbs2();
      curvature += mean.omega_ddot_radps3.cwiseAbs2();
      mean = ReferenceMean{};
      position = 0;
      ++used;
    }
    // Between the reference's samples single values are better and single slopes worse known than at them.
    const double tolerance = n == 1 ? 0.35 : 0.05;
    EXPECT_NEAR(std::sqrt(value.mean() / kWindows) / gains.value, 1.0, tolerance) << n;
    EXPECT_NEAR(std::sqrt(slope.mean() / kWindows) / gains.slope_per_s, 1.0, tolerance) << n;
    if (n == 1) continue;
    EXPECT_NEAR(std::sqrt(curvature.mean() / kWindows) / gains.curvature_per_s2, 1.0, 0.1) << n;
  }
}

TEST(UpdateWindow, LongWindowsKeepNoiseOutAsTheirLengthToThreeHalves) {
  // Continuous Hann window: var of the slope = 2 pi^2 S^2 / T^3.
  for (const int n : {10, 20, 50}) {
    const double T_s = 2.0 * n / kRate_hz;
    const double expected = std::sqrt(2.0 * kPi * kPi / (T_s * T_s * T_s) / kRate_hz);
    EXPECT_NEAR(noise_gains(kReference, kRate_hz, n).slope_per_s, expected, 0.03 * expected) << n;
  }
}

/// Windows of noise, and of motion under it.
struct Windows {
  std::mt19937_64 random{41};
  double rate_sd_radps = 0.01;
  double force_sd_mps2 = 0.03;
  NoiseGains gains = noise_gains(kReference, kRate_hz, 10);
  MotionShare share;
  int k = 0;

  Windows() { share.set_noise(rate_sd_radps, force_sd_mps2, gains); }

  ReferenceMean next(double motion_radps) {
    ReferenceMean b;
    const double phase = 0.1 * ++k;
    const Vector3d direction(0.1, 0.1, 1.0);
    b.omega_radps = motion_radps * std::sin(phase) * direction + noise(random, rate_sd_radps * gains.value);
    b.omega_dot_radps2 =
        motion_radps * std::cos(phase) * direction + noise(random, rate_sd_radps * gains.slope_per_s);
    b.f_mps2 = Vector3d(0, 0, -9.8) + noise(random, force_sd_mps2 * gains.value);
    share.add(b, Vector3d::Zero(), Vector3d::Zero(), 0.1);
    return b;
  }
};

TEST(MotionShare, RestShowsNothingHoweverLong) {
  Windows windows;
  for (int i = 0; i < 50'000; ++i) {
    const ReferenceMean believed = windows.share.believed(windows.next(0.0));
    ASSERT_FALSE(windows.share.moving()) << i;
    ASSERT_EQ(believed.omega_dot_radps2, Vector3d::Zero());
    ASSERT_EQ(believed.omega_omega, Eigen::Matrix3d::Zero());
  }
}

TEST(MotionShare, IsTheShareOfMotionOnEachAxis) {
  Windows windows;
  constexpr double kMotion_radps = 0.3;
  for (int i = 0; i < 5'000; ++i) windows.next(kMotion_radps);
  const Vector3d share = windows.share.rate_slope_share();
  const double noise = std::pow(windows.rate_sd_radps * windows.gains.slope_per_s, 2);
  const double motion = 0.5 * kMotion_radps * kMotion_radps;
  EXPECT_NEAR(share.z(), motion / (motion + noise), 0.02);
  EXPECT_NEAR(windows.share.noise_in_rate_slope(), 3.0 * noise / (3.0 * noise + 1.02 * motion), 0.02);
  EXPECT_LT(share.x(), share.z()) << "an axis with less motion is believed less";
}

TEST(MotionShare, CannotTellATurnFromABiasByOneWindow) {
  MotionShare share;
  share.set_noise(1e-5, 1e-3, noise_gains(kReference, kRate_hz, 10));
  EXPECT_FALSE(share.can_tell());
  ReferenceMean turn;
  turn.f_mps2 = Vector3d(0, 0, -9.8);
  for (int i = 0; i < 2; ++i) {
    turn.omega_radps = Vector3d(0, 0, 0.1 + 0.05 * i);
    turn.omega_dot_radps2 = Vector3d(0, 0, 0.5);
    share.add(turn, Vector3d::Zero(), Vector3d::Zero(), 0.1);
    EXPECT_EQ(share.can_tell(), i == 1);
  }
  EXPECT_TRUE(share.moving());
}

TEST(MotionShare, AnEstimateOfABiasThatMovesIsNoMotion) {
  Windows windows;
  for (int i = 0; i < 1'000; ++i) {
    const Vector3d bias_radps = Vector3d::Constant(0.005 * (1.0 - std::exp(-0.01 * i)));
    ReferenceMean b;
    b.omega_radps = Vector3d::Constant(0.005) - bias_radps +
                    noise(windows.random, windows.rate_sd_radps * windows.gains.value);
    b.f_mps2 = Vector3d(0, 0, -9.8);
    windows.share.add(b, bias_radps, Vector3d::Zero(), 0.1);
    ASSERT_FALSE(windows.share.moving()) << i;
  }
}

TEST(WindowChoice, GrowsWithTheNoiseAndStaysWhereItIsConfigured) {
  for (const double sd_radps : {1e-5, 1.4e-2}) {
    for (const int configured : {0, 7}) {
      WindowChoice choice(kReference, kRate_hz);
      choice.fix(configured);
      Windows windows;
      windows.rate_sd_radps = sd_radps;
      windows.gains = choice.now().gains;
      windows.share.set_noise(sd_radps, windows.force_sd_mps2, windows.gains);
      for (int i = 0; i < 3'000; ++i) {
        windows.next(0.1);
        if (!choice.choose(windows.share)) continue;
        windows.gains = choice.now().gains;
        windows.share.set_noise(sd_radps, windows.force_sd_mps2, windows.gains);
      }
      const int expected = configured != 0 ? configured : (sd_radps < 1e-3 ? 10 : 50);
      EXPECT_EQ(choice.now().n, expected) << sd_radps;
    }
  }
}

}  // namespace
}  // namespace imuscope
