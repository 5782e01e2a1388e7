#include "estimation/alignment/reference_window.h"

#include <gtest/gtest.h>
#include <cmath>
#include <limits>
#include <random>

#include "base/limits.h"
#include "sample/eigen_arrays.h"
#include "tests/estimation/alignment/analytic_motion.h"

namespace imuscope {
namespace {

using Eigen::Vector3d;

constexpr double kPeriod_s = 0.01;

HostTime at(double seconds) { return HostTime{from_seconds(seconds)}; }

Sample imu_sample(double t, const Vector3d& omega, const Vector3d& f, std::uint32_t flags = 0) {
  Sample sample{};
  sample.kind = SampleKind::kImu;
  sample.time = at(t);
  sample.imu.omega_radps = to_array(omega);
  sample.imu.f_mps2 = to_array(f);
  sample.imu.flags = flags | kGyroValid | kAccelValid;
  return sample;
}

/// A window filled with instantaneous samples of the motion, up to `end`.
ReferenceWindow filled(int points, const test::SineSum& omega, const test::SineSum& f, double end = 1.0,
                       double jitter_s = 0.0) {
  ReferenceWindow window({points, kPeriod_s});
  std::mt19937 random(7);
  std::uniform_real_distribution<> jitter(-jitter_s, jitter_s + 1e-12);
  for (int i = 0; i * kPeriod_s <= end + 1e-9; ++i) {
    const double t = i * kPeriod_s + jitter(random);
    EXPECT_TRUE(window.push(imu_sample(t, omega(t), f(t))));
  }
  return window;
}

TEST(ReferenceWindow, APolynomialOfOrderFourIsReproducedWithAllItsDerivatives) {
  // y = sum c_k t^k: any 5-point window must return it exactly, between samples too.
  const auto y = [](double t, int n) {
    const double c[5] = {0.3, -1.2, 4.0, 20.0, -150.0};
    double sum = 0.0;
    for (int k = n; k < 5; ++k) {
      double factor = c[k];
      for (int j = 0; j < n; ++j) factor *= k - j;
      sum += factor * std::pow(t - 0.5, k - n);
    }
    return sum;
  };
  for (const int points : {5, 7, 9, 11}) {
    ReferenceWindow window({points, kPeriod_s});
    for (int i = 0; i <= 100; ++i) {
      const double t = i * kPeriod_s;
      ASSERT_TRUE(window.push(imu_sample(t, Vector3d::Constant(y(t, 0)), Vector3d::Constant(2.0 * y(t, 0)))));
    }
    for (const double t : {0.5, 0.5032, 0.4961}) {
      ReferenceKinematics out;
      ASSERT_EQ(window.evaluate(at(t), out), ReferenceResult::kOk);
      EXPECT_NEAR(out.omega_radps.x(), y(t, 0), 1e-12);
      EXPECT_NEAR(out.omega_dot_radps2.y(), y(t, 1), 1e-9);
      EXPECT_NEAR(out.omega_ddot_radps3.z(), y(t, 2), 1e-6);
      EXPECT_NEAR(out.f_mps2.x(), 2.0 * y(t, 0), 1e-12);
      EXPECT_NEAR(out.f_dot_mps3.x(), 2.0 * y(t, 1), 1e-9);
    }
  }
}

struct Gain {
  int points;
  double noise_per_s;        // published noise gain at 100 Hz
  double amplitude_at_5_hz;  // of the derivative
  double amplitude_at_10_hz;
};

TEST(ReferenceWindow, NoiseGainAndAmplitudeAreThoseOfSavitzkyGolayAtTheSamples) {
  // Savitzky-Golay first derivative of order 4 at 100 Hz, gains in 1/s and amplitudes at 5 and 10 Hz, from
  // the closed weights (1, -8, 0, 8, -1)/12 for 5 points and the tabulated 7 and 11 point sets.
  for (const Gain& g :
       {Gain{5, 95.0, 0.9997, 0.995}, Gain{7, 51.2, 0.998, 0.971}, Gain{11, 24.6, 0.986, 0.823}}) {
    for (const double hz : {5.0, 10.0}) {
      const double rate = 2.0 * std::numbers::pi * hz;
      ReferenceWindow window({g.points, kPeriod_s});
      for (int i = 0; i <= 100; ++i) {
        const double t = i * kPeriod_s;
        ASSERT_TRUE(
            window.push(imu_sample(t, Vector3d::Constant(std::sin(rate * (t - 0.5))), Vector3d::Zero())));
      }
      ReferenceKinematics out;
      ASSERT_EQ(window.evaluate(at(0.5), out), ReferenceResult::kOk);
      EXPECT_NEAR(out.omega_dot_radps2.x() / rate, hz == 5.0 ? g.amplitude_at_5_hz : g.amplitude_at_10_hz,
                  6e-4);
      EXPECT_NEAR(out.derivative_noise_gain_per_s, g.noise_per_s, 0.06);
    }
  }
}

TEST(ReferenceWindow, ValueNoiseGainIsTheSpreadOfTheValueForWhiteSamples) {
  std::mt19937 random(3);
  std::normal_distribution<> noise(0.0, 1.0);
  ReferenceWindow window({7, kPeriod_s});
  double value_sum = 0.0, slope_sum = 0.0;
  ReferenceKinematics out;
  constexpr int kCount = 20000;
  for (int i = 0; i < kCount + 6; ++i) {
    ASSERT_TRUE(window.push(imu_sample(i * kPeriod_s, Vector3d(noise(random), 0, 0), Vector3d::Zero())));
    if (i < 6) continue;
    ASSERT_EQ(window.evaluate(at((i - 3) * kPeriod_s + 0.003), out), ReferenceResult::kOk);
    value_sum += out.omega_radps.x() * out.omega_radps.x();
    slope_sum += out.omega_dot_radps2.x() * out.omega_dot_radps2.x();
  }
  EXPECT_NEAR(std::sqrt(value_sum / kCount), out.value_noise_gain, 0.03);
  EXPECT_NEAR(std::sqrt(slope_sum / kCount), out.derivative_noise_gain_per_s,
              0.03 * out.derivative_noise_gain_per_s);
}

TEST(ReferenceWindow, FollowsACarBetweenItsSamples) {
  const test::SineSum omega = test::car_rates(1);
  const test::SineSum f = test::car_forces(1);
  const ReferenceWindow window = filled(5, omega, f, 2.0);
  for (double t = 0.3; t < 1.9; t += 0.0037) {
    ReferenceKinematics out;
    ASSERT_EQ(window.evaluate(at(t), out), ReferenceResult::kOk);
    EXPECT_LT((out.omega_radps - omega(t)).norm(), 1e-6);
    EXPECT_LT((out.omega_dot_radps2 - omega.derivative(t, 1)).norm(), 5e-4);
    EXPECT_LT((out.omega_ddot_radps3 - omega.derivative(t, 2)).norm(), 0.2);
    EXPECT_LT((out.f_mps2 - f(t)).norm(), 2e-5);
    EXPECT_LT((out.f_dot_mps3 - f.derivative(t, 1)).norm(), 1e-2);
  }
}

TEST(ReferenceWindow, JitterOfTheStampsDoesNoHarmBecauseActualTimesAreUsed) {
  const test::SineSum omega = test::car_rates(2);
  const test::SineSum f = test::car_forces(2);
  const ReferenceWindow window = filled(5, omega, f, 2.0, 1e-3);
  for (double t = 0.3; t < 1.9; t += 0.0037) {
    ReferenceKinematics out;
    ASSERT_EQ(window.evaluate(at(t), out), ReferenceResult::kOk);
    EXPECT_LT((out.omega_dot_radps2 - omega.derivative(t, 1)).norm(), 1e-3);
  }
}

TEST(ReferenceWindow, MeansOverTheIntervalGiveTheInstantaneousMotion) {
  // Increments: the mean over [t - T, t], stamped t. Neither half a sample of delay nor lost amplitude
  // remains.
  const test::SineSum omega = test::car_rates(3);
  const test::SineSum f = test::car_forces(3);
  ReferenceWindow window({5, kPeriod_s});
  for (int i = 1; i <= 200; ++i) {
    const double t = i * kPeriod_s;
    ASSERT_TRUE(
        window.push(imu_sample(t, omega.mean(t - kPeriod_s, t), f.mean(t - kPeriod_s, t), kIsIncrement)));
  }
  for (double t = 0.3; t < 1.9; t += 0.0037) {
    ReferenceKinematics out;
    ASSERT_EQ(window.evaluate(at(t), out), ReferenceResult::kOk);
    EXPECT_LT((out.omega_radps - omega(t)).norm(), 2e-6);
    EXPECT_LT((out.omega_dot_radps2 - omega.derivative(t, 1)).norm(), 8e-4);
    EXPECT_LT((out.f_mps2 - f(t)).norm(), 4e-5);
  }
}

TEST(ReferenceWindow, TheDevicesOwnAngularAccelerationIsPreferred) {
  ReferenceWindow window({5, kPeriod_s});
  for (int i = 0; i <= 20; ++i) {
    Sample sample = imu_sample(i * kPeriod_s, Vector3d::Zero(), Vector3d::Zero(), kHasAngularAcceleration);
    sample.imu.angular_acceleration_radps2 = {0.5, 0.1 * i, 0.0};
    ASSERT_TRUE(window.push(sample));
  }
  ReferenceKinematics out;
  ASSERT_EQ(window.evaluate(at(0.1), out), ReferenceResult::kOk);
  EXPECT_TRUE(out.angular_acceleration_is_measured);
  EXPECT_NEAR(out.omega_dot_radps2.x(), 0.5, 1e-12);
  EXPECT_NEAR(out.omega_dot_radps2.y(), 1.0, 1e-12);
  EXPECT_NEAR(out.omega_ddot_radps3.y(), 10.0, 1e-9);
}

TEST(ReferenceWindow, SaysWhenToWaitAndWhenItIsTooLate) {
  const test::SineSum omega = test::car_rates(4);
  const test::SineSum f = test::car_forces(4);
  const ReferenceWindow window = filled(5, omega, f, 10.0);
  ReferenceKinematics out;
  EXPECT_EQ(window.evaluate(at(10.0), out), ReferenceResult::kTooNew);
  EXPECT_EQ(window.evaluate(at(9.99), out), ReferenceResult::kTooNew);
  EXPECT_EQ(window.evaluate(at(9.98), out), ReferenceResult::kOk);
  // Of the five points' centres the newest is at 9.98 s; beyond half a period after it the next is nearer.
  EXPECT_EQ(window.evaluate(at(9.9849), out), ReferenceResult::kOk);
  EXPECT_EQ(window.evaluate(at(9.9851), out), ReferenceResult::kTooNew);
  EXPECT_EQ(window.evaluate(at(1.0), out), ReferenceResult::kOk);  // two minutes are kept
  EXPECT_EQ(window.evaluate(at(-0.1), out), ReferenceResult::kTooOld);
  EXPECT_EQ(ReferenceWindow({5, kPeriod_s}).evaluate(at(1.0), out), ReferenceResult::kTooNew);
}

TEST(ReferenceWindow, ReachesBackTheSameTimeAtTheHighestRate) {
  constexpr double kFast_s = 1.0 / kMaxRate_hz;
  ReferenceWindow window({5, kFast_s});
  for (int k = 0; k < 8000; ++k) {
    Sample sample{};
    sample.kind = SampleKind::kImu;
    sample.time = at(k * kFast_s);
    ASSERT_TRUE(window.push(sample));
  }
  ReferenceKinematics out;
  const double newest_s = 8000 * kFast_s;
  EXPECT_EQ(window.evaluate(at(newest_s - kReferencePast_s), out), ReferenceResult::kOk);
}

TEST(ReferenceWindow, DoesNotInterpolateOverAGap) {
  ReferenceWindow window({5, kPeriod_s});
  for (int i = 0; i <= 100; ++i) {
    if (i == 50) continue;
    ASSERT_TRUE(window.push(imu_sample(i * kPeriod_s, Vector3d::Zero(), Vector3d::Zero())));
  }
  ReferenceKinematics out;
  EXPECT_EQ(window.evaluate(at(0.47), out), ReferenceResult::kOk);
  EXPECT_EQ(window.evaluate(at(0.48), out), ReferenceResult::kGap);
  EXPECT_EQ(window.evaluate(at(0.50), out), ReferenceResult::kGap);
  EXPECT_EQ(window.evaluate(at(0.52), out), ReferenceResult::kGap);
  EXPECT_EQ(window.evaluate(at(0.53), out), ReferenceResult::kOk);
}

TEST(ReferenceWindow, RefusesTimeRunningBackwardsAndWhatIsNotANumber) {
  ReferenceWindow window({5, kPeriod_s});
  EXPECT_TRUE(window.push(imu_sample(0.02, Vector3d::Zero(), Vector3d::Zero())));
  EXPECT_FALSE(window.push(imu_sample(0.02, Vector3d::Zero(), Vector3d::Zero())));
  EXPECT_FALSE(window.push(imu_sample(0.01, Vector3d::Zero(), Vector3d::Zero())));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(window.push(imu_sample(0.03, Vector3d(nan, 0, 0), Vector3d::Zero())));
  EXPECT_EQ(window.size(), 1U);
}

}  // namespace
}  // namespace imuscope
