#include "estimation/calibration/resting_noise.h"

#include <gtest/gtest.h>
#include <cmath>
#include <functional>
#include <random>

#include "base/units.h"
#include "estimation/calibration/estimator.h"
#include "sample/eigen_arrays.h"
#include "tests/estimation/calibration/simulated_drive.h"

namespace imuscope {
namespace {

using Eigen::Vector3d;

constexpr double kReferenceRate_hz = 100.0;
constexpr double kWindow_s = 8.0;
/// A better MEMS; rad/s, m/s^2 a sample.
constexpr double kRateNoise_radps = 5e-4;
constexpr double kForceNoise_mps2 = 5e-3;

class Noise {
 public:
  explicit Noise(std::uint64_t seed) : random_(seed) {}
  Vector3d operator()(double sd) {
    const double x = normal_(random_);
    const double y = normal_(random_);
    return sd * Vector3d(x, y, normal_(random_));
  }

 private:
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
};

/// What `shows` adds to a resting IMU, for as long as is said; how often something new was seen.
int feed(RestingNoise& resting, Noise& noise, double duration_s, double rate_hz,
         const std::function<void(double t_s, Vector3d& omega, Vector3d& f)>& shows) {
  int changes = 0;
  for (int k = 0; k < static_cast<int>(duration_s * rate_hz); ++k) {
    Vector3d omega = Vector3d(2e-3, -1e-3, 5e-4) + noise(kRateNoise_radps);
    Vector3d f = Vector3d(0.3, 0.1, -9.8) + noise(kForceNoise_mps2);
    shows(k / rate_hz, omega, f);
    changes += resting.add(omega, f, 1.0 / rate_hz) ? 1 : 0;
  }
  return changes;
}

void nothing(double /*t_s*/, Vector3d& /*omega*/, Vector3d& /*f*/) {}

TEST(RestingNoise, IsKnownAsWellAsItSays) {
  for (const double rate_hz : {50.0, 100.0, 128.0, 400.0}) {
    for (const int windows : {1, 6}) {
      constexpr int kRuns = 300;
      double squares = 0.0;
      double known_to = 0.0;
      int used = 0;
      for (int run = 0; run < kRuns; ++run) {
        Noise noise(static_cast<std::uint64_t>(run));
        RestingNoise resting(rate_hz);
        // A piece is a whole number of samples, and may be longer than a tenth of a second.
        // By chance a window does not look white, and begins anew.
        if (feed(resting, noise, windows * kWindow_s * 1.02, rate_hz, nothing) != windows) continue;
        ++used;
        const double variance = std::pow(resting.seen()->gyro_radps_per_sqrt_hz, 2) * rate_hz;
        squares += std::pow(variance / (kRateNoise_radps * kRateNoise_radps) - 1.0, 2);
        known_to = resting.seen()->known_to;
        EXPECT_NEAR(resting.seen()->accel_mps2_per_sqrt_hz * std::sqrt(rate_hz), kForceNoise_mps2,
                    0.3 * kForceNoise_mps2);
      }
      EXPECT_GT(used, kRuns * 19 / 20) << rate_hz << " Hz, " << windows;
      // An rms of 300 is good to 4 %.
      EXPECT_NEAR(std::sqrt(squares / used), known_to, 0.15 * known_to) << rate_hz << " Hz, " << windows;
    }
  }
}

TEST(RestingNoise, OfALowPassedSensorIsThatOfSlowMotion) {
  Noise noise(3);
  RestingNoise resting(kReferenceRate_hz);
  Vector3d low = Vector3d::Zero();
  constexpr double kShare = 0.5;  // a sample; a low-pass of 11 Hz
  feed(resting, noise, 6 * kWindow_s, kReferenceRate_hz, [&](double, Vector3d& omega, Vector3d&) {
    low += kShare * (omega - low);
    omega = low;
  });
  ASSERT_TRUE(resting.seen());
  // As its samples scatter, it would be taken for better by sqrt(3).
  EXPECT_NEAR(resting.seen()->gyro_radps_per_sqrt_hz * std::sqrt(kReferenceRate_hz), kRateNoise_radps,
              0.2 * kRateNoise_radps);
}

TEST(RestingNoise, MotionIsNone) {
  struct Case {
    const char* what;
    double hz;
    double rate_radps;
    double force_mps2;
  };
  for (const Case& moves : {Case{"turns", 0.05, 0.2, 0.0}, Case{"sways", 0.3, 0.01, 0.0},
                            Case{"pulls away and brakes", 0.05, 0.0, 1.0}}) {
    Noise noise(4);
    RestingNoise resting(kReferenceRate_hz);
    const int seen =
        feed(resting, noise, 120.0, kReferenceRate_hz, [&](double t_s, Vector3d& omega, Vector3d& f) {
          omega.z() += moves.rate_radps * std::sin(2.0 * kPi * moves.hz * t_s);
          f.x() += moves.force_mps2 * std::sin(2.0 * kPi * moves.hz * t_s);
        });
    EXPECT_EQ(seen, 0) << moves.what;
  }
}

TEST(RestingNoise, QuieterRestTellsMoreAndShakingNothing) {
  Noise noise(5);
  RestingNoise resting(kReferenceRate_hz);
  const auto shaken = [&noise](double, Vector3d& omega, Vector3d& f) {
    omega += noise(5.0 * kRateNoise_radps);
    f += noise(5.0 * kForceNoise_mps2);
  };
  const auto gyro_radps = [&resting] {
    return resting.seen()->gyro_radps_per_sqrt_hz * std::sqrt(kReferenceRate_hz);
  };
  feed(resting, noise, 2.0 * kWindow_s, kReferenceRate_hz, shaken);
  EXPECT_GT(gyro_radps(), 4.0 * kRateNoise_radps);
  feed(resting, noise, 2.0 * kWindow_s, kReferenceRate_hz, nothing);
  EXPECT_NEAR(gyro_radps(), kRateNoise_radps, 0.2 * kRateNoise_radps);
  const double before = gyro_radps();
  EXPECT_EQ(feed(resting, noise, 2.0 * kWindow_s, kReferenceRate_hz, shaken), 0);
  EXPECT_EQ(gyro_radps(), before);
}

TEST(RestingNoise, WhatIsNoisierThanAnyReferenceIsShaken) {
  Noise noise(8);
  RestingNoise resting(kReferenceRate_hz);
  const auto by_hand = [&noise](double, Vector3d& omega, Vector3d&) { omega += noise(0.05); };
  EXPECT_EQ(feed(resting, noise, 4.0 * kWindow_s, kReferenceRate_hz, by_hand), 0);
}

TEST(RestingNoise, AGapEndsAWindow) {
  Noise noise(6);
  RestingNoise resting(kReferenceRate_hz);
  EXPECT_EQ(feed(resting, noise, 7.0, kReferenceRate_hz, nothing), 0);
  EXPECT_FALSE(resting.add(Vector3d(2e-3, -1e-3, 5e-4), Vector3d(0.3, 0.1, -9.8), 0.5));
  EXPECT_EQ(feed(resting, noise, 7.0, kReferenceRate_hz, nothing), 0);
  EXPECT_EQ(feed(resting, noise, 1.0, kReferenceRate_hz, nothing), 1);
}

/// A drive whose reference is as noisy as an MTx; the estimate at its end.
struct End {
  SImuOutput study;
  double error_r_m = 0.0;
  int told = 0;
  double told_radps_per_sqrt_hz = 0.0;
};
End end_of_noisy_drive(bool is_known) {
  constexpr double kMtxRate_radps = 0.8 * kRadPerDeg;
  test::SimulatedStudy truth;
  truth.r_bs_b_m = Vector3d(1.0, -0.7, 0.3);
  test::SimulatedDrive drive(400.0, {truth});
  EstimatorConfig config = drive.config();
  config.reference.is_known = is_known;
  Estimator estimator(config);
  Noise noise(7);
  End end;
  while (!drive.done()) {
    for (Sample sample : drive.next()) {
      if (sample.device == test::SimulatedDrive::kReference && sample.kind == SampleKind::kImu)
        sample.imu.omega_radps = to_array(Vector3d(to_eigen(sample.imu.omega_radps) + noise(kMtxRate_radps)));
      estimator.add(sample);
      estimator.advance(sample.arrival);
      for (const EstimatorEvent& event : estimator.events()) {
        const auto* seen = std::get_if<event::ReferenceNoiseSeen>(&event.what);
        if (seen == nullptr) continue;
        ++end.told;
        end.told_radps_per_sqrt_hz = seen->gyro_radps_per_sqrt_hz;
      }
    }
  }
  end.study = estimator.study(0);
  end.error_r_m = (to_eigen(end.study.r_bs_b_m) - truth.r_bs_b_m).norm();
  return end;
}

TEST(RestingNoise, OfAReferenceThatNobodyKnowsTakesNoLeverArm) {
  const End untold = end_of_noisy_drive(false);
  EXPECT_EQ(untold.told, 1);
  EXPECT_NEAR(untold.told_radps_per_sqrt_hz * std::sqrt(kReferenceRate_hz), 0.8 * kRadPerDeg,
              0.1 * 0.8 * kRadPerDeg);
  const double sd_m = to_eigen(untold.study.sd_r_bs_b_m).norm();
  EXPECT_LT(untold.error_r_m, 2.5 * sd_m);
  EXPECT_LT(sd_m, 0.05);

  // As navigation grade it is wrong and sure of itself.
  const End taken_for_good = end_of_noisy_drive(true);
  EXPECT_EQ(taken_for_good.told, 0);
  EXPECT_GT(taken_for_good.error_r_m, 5.0 * to_eigen(taken_for_good.study.sd_r_bs_b_m).norm());
}

}  // namespace
}  // namespace imuscope
