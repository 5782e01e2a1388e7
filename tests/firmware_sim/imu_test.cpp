#include <gtest/gtest.h>
#include <cmath>
#include <numbers>
#include <vector>

#include "firmware_sim/imu/imu_model.h"
#include "firmware_sim/imu/noise.h"
#include "firmware_sim/imu/sensor_classes.h"
#include "firmware_sim/motion/degrees.h"

namespace imusim {
namespace {

constexpr double kStep_s = 0.01;

std::vector<double> draw(NoiseSource& source, Regime regime, int count) {
  std::vector<double> values;
  for (int i = 0; i < count; ++i) values.push_back(source.next(regime, kStep_s));
  return values;
}

/// Mean of x_k x_{k+lag}: the processes have zero mean by definition.
double covariance(const std::vector<double>& x, std::size_t lag) {
  double sum = 0.0;
  for (std::size_t i = 0; i + lag < x.size(); ++i) sum += x[i] * x[i + lag];
  return sum / static_cast<double>(x.size() - lag);
}

TEST(NoiseSource, WhiteNoiseHasItsVarianceAndNoCorrelation) {
  NoiseSource source(same_in_both({0.25, {}}), RegimeSwitch::kContinuous, Random(3, "white"));
  constexpr int kCount = 200000;
  const std::vector<double> x = draw(source, Regime::kStatic, kCount);
  EXPECT_NEAR(covariance(x, 0), 0.25, 5.0 * 0.25 * std::sqrt(2.0 / kCount));
  for (const std::size_t lag : {1U, 2U, 10U})
    EXPECT_NEAR(covariance(x, lag), 0.0, 5.0 * 0.25 / std::sqrt(double{kCount}));
}

TEST(NoiseSource, AGaussMarkovProcessHasItsExponentialCovariance) {
  constexpr double kVariance = 2.0;
  constexpr double kBeta = 5.0;
  NoiseSource source(same_in_both({0.0, {{kVariance, kBeta}}}), RegimeSwitch::kContinuous, Random(4, "gm"));
  constexpr int kCount = 1000000;
  const std::vector<double> x = draw(source, Regime::kStatic, kCount);
  // Bartlett: variance of the lag estimates of an AR(1) is at most sigma^4 (2 / N) (1 + phi^2) / (1 - phi^2).
  const double phi = std::exp(-kBeta * kStep_s);
  const double sd = kVariance * std::sqrt(2.0 / kCount * (1.0 + phi * phi) / (1.0 - phi * phi));
  for (const std::size_t lag : {0U, 1U, 10U, 40U})
    EXPECT_NEAR(covariance(x, lag), kVariance * std::exp(-kBeta * kStep_s * static_cast<double>(lag)),
                5.0 * sd)
        << "lag " << lag;
}

TEST(NoiseSource, StartsFromItsStationaryDistribution) {
  constexpr int kSources = 4000;
  double first = 0.0;
  double hundredth = 0.0;
  for (int i = 0; i < kSources; ++i) {
    NoiseSource source(same_in_both({0.0, {{1.0, 0.01}}}), RegimeSwitch::kContinuous,
                       Random(static_cast<std::uint64_t>(i), "start"));
    const std::vector<double> x = draw(source, Regime::kStatic, 100);
    first += x.front() * x.front() / kSources;
    hundredth += x.back() * x.back() / kSources;
  }
  const double sd = std::sqrt(2.0 / kSources);
  EXPECT_NEAR(first, 1.0, 5.0 * sd);
  EXPECT_NEAR(hundredth, 1.0, 5.0 * sd);
}

TEST(NoiseSource, ASlowProcessKeepsItsValueThroughAChangeOfRegime) {
  const RegimeNoise noise{{0.0, {{1.0, 0.001}}}, {0.0, {{9.0, 0.001}}}};
  NoiseSource source(noise, RegimeSwitch::kContinuous, Random(5, "switch"));
  const double before = draw(source, Regime::kStatic, 10).back();
  const double after = source.next(Regime::kDynamic, kStep_s);
  // One step's driving noise: sqrt(9 (1 - exp(-2 * 0.001 * 0.01))) = 0.0134.
  EXPECT_NEAR(after, before, 5.0 * 0.0134);
}

TEST(NoiseSource, IndependentRegimesAreEachStationaryFromTheirFirstSample) {
  const RegimeNoise noise{{0.0, {{1.0, 0.001}}}, {0.0, {{9.0, 0.001}}}};
  constexpr int kSources = 4000;
  double in_motion = 0.0;
  double product = 0.0;
  double back_at_rest = 0.0;
  for (int i = 0; i < kSources; ++i) {
    NoiseSource source(noise, RegimeSwitch::kIndependent, Random(static_cast<std::uint64_t>(i), "apart"));
    const double at_rest = source.next(Regime::kStatic, kStep_s);
    const double moving = source.next(Regime::kDynamic, kStep_s);
    const double rest_again = source.next(Regime::kStatic, kStep_s);
    in_motion += moving * moving / kSources;
    product += at_rest * moving / kSources;
    back_at_rest += (rest_again - at_rest) * (rest_again - at_rest) / kSources;
  }
  EXPECT_NEAR(in_motion, 9.0, 5.0 * 9.0 * std::sqrt(2.0 / kSources));
  EXPECT_NEAR(product, 0.0, 5.0 * 3.0 / std::sqrt(double{kSources}));
  EXPECT_LT(back_at_rest, 1e-3);
}

class ImuModelTest : public testing::Test {
 protected:
  static const Motion& motion() {
    static const Motion drive = [] {
      Scenario scenario;
      scenario.duration_s = 120.0;
      return Motion(scenario);
    }();
    return drive;
  }
  static ImuReading one_sample(const ImuErrors& errors, double t_s = 40.0) {
    ImuModel model(motion(), Mounting{}, errors, 1, "one");
    return model.sample_at(t_s);
  }
};

TEST_F(ImuModelTest, WithoutErrorsItReadsTheMotionAtItsPlaceInItsAxes) {
  Mounting mounting;
  mounting.C_b_s << 0, 1, 0, -1, 0, 0, 0, 0, 1;  // s: x to the right, y backwards
  mounting.r_bs_b_m = {0.35, -0.22, 0.12};
  ImuModel model(motion(), mounting, ImuErrors{}, 1, "perfect");
  const MotionState state = motion().state_at(42.0);
  const ImuReading reading = model.sample_at(42.0);
  EXPECT_EQ(reading.omega_radps.x(), state.omega_ib_b_radps.y());
  EXPECT_EQ(reading.omega_radps.y(), -state.omega_ib_b_radps.x());
  const Eigen::Vector3d f_b = specific_force_at(state, mounting.r_bs_b_m);
  EXPECT_EQ(reading.f_mps2.x(), f_b.y());
  EXPECT_EQ(reading.gyro_error_radps.norm(), 0.0);
  EXPECT_EQ(reading.accel_error_mps2.norm(), 0.0);
}

TEST_F(ImuModelTest, EachSystematicErrorDoesWhatItsNameSays) {
  const MotionState state = motion().state_at(40.0);
  const Eigen::Vector3d omega = state.omega_ib_b_radps;
  ImuErrors errors;
  errors.gyro.bias = {0.01, -0.02, 0.03};
  errors.gyro.scale = {0.001, 0.0, -0.002};
  errors.gyro.misalignment(0, 2) = 0.005;
  errors.gyro.g_sensitivity(1, 1) = 1e-4;
  errors.accel.scale = {0.0, 0.0, 0.01};
  const ImuReading reading = one_sample(errors);
  EXPECT_NEAR(reading.gyro_error_radps.x(), 0.01 + 0.001 * omega.x() + 0.005 * omega.z(), 1e-15);
  EXPECT_NEAR(reading.gyro_error_radps.y(), -0.02 + 1e-4 * state.f_b_mps2.y(), 1e-15);
  EXPECT_NEAR(reading.gyro_error_radps.z(), 0.03 - 0.002 * omega.z(), 1e-15);
  EXPECT_NEAR(reading.accel_error_mps2.z(), 0.01 * state.f_b_mps2.z(), 1e-13);
}

TEST_F(ImuModelTest, ReadingsEndAtTheRangeAndFallOnSteps) {
  ImuErrors errors;
  errors.accel.range = 5.0;
  errors.gyro.quantisation = 0.001;
  errors.gyro.bias = {0.01234, 0.0, 0.0};
  const ImuReading reading = one_sample(errors, 5.0);
  EXPECT_EQ(reading.f_mps2.z(), -5.0);
  for (const double rate : reading.omega_radps) EXPECT_NEAR(rate / 0.001, std::round(rate / 0.001), 1e-9);
}

TEST_F(ImuModelTest, ALowPassDelaysTheMotionAsAButterworthOfSecondOrderDoes) {
  constexpr double kCorner_hz = 40.0;
  const double tau_s = 1.0 / (2.0 * 3.14159265358979323846 * kCorner_hz);
  ImuErrors errors;
  errors.gyro.low_pass_hz = kCorner_hz;
  ImuModel model(motion(), Mounting{}, errors, 1, "slow");
  for (double t_s = 30.0; t_s < 60.0; t_s += kStep_s) {
    const Eigen::Vector3d error = model.sample_at(t_s).gyro_error_radps;
    if (t_s < 30.1) continue;
    // 1 / (1 + sqrt(2) tau s + tau^2 s^2) = 1 - sqrt(2) tau s + tau^2 s^2 + 0 s^3 - tau^4 s^4 ...; with the straight
    // lines of a millisecond less is left than a fifth of tau^3 omega''' with omega''' below 60 rad/s^4.
    const auto acceleration = [](double t) { return motion().state_at(t).omega_dot_ib_b_radps2; };
    const Eigen::Vector3d jerk = (acceleration(t_s + 1e-3) - acceleration(t_s - 1e-3)) / 2e-3;
    const Eigen::Vector3d expected = -std::numbers::sqrt2 * tau_s * acceleration(t_s) + tau_s * tau_s * jerk;
    EXPECT_LT((error - expected).norm(), 12.0 * tau_s * tau_s * tau_s);
  }
}

TEST_F(ImuModelTest, NamesSeparateTheNoiseOfTwoDevicesAndSeedsThatOfTwoRuns) {
  Random random(1, "draw");
  const ImuErrors errors = draw_mtx(MtxClass{}, random);
  const auto first_rate = [&](std::uint64_t seed, const char* name) {
    return ImuModel(motion(), Mounting{}, errors, seed, name).sample_at(1.0).omega_radps.x();
  };
  EXPECT_EQ(first_rate(1, "mtx1"), first_rate(1, "mtx1"));
  EXPECT_NE(first_rate(1, "mtx1"), first_rate(1, "mtx2"));
  EXPECT_NE(first_rate(1, "mtx1"), first_rate(2, "mtx1"));
}

TEST(SensorClasses, TheMtxHasTableTwoOfThePaper) {
  const RegimeNoise noise = mtx_gyro_noise(GyroNoiseChoice::kByRegime);
  const double unit = kRadPerDeg * kRadPerDeg;
  EXPECT_NEAR(noise.at_rest.white_variance / unit, 0.50552, 1e-12);
  EXPECT_NEAR(noise.in_motion.white_variance / unit, 0.65382, 1e-12);
  // Section 1.1 of the navigation notes: GM1 is 136 deg/h with 203 s at rest, 357 deg/h with 645 s in motion.
  EXPECT_NEAR(std::sqrt(noise.at_rest.processes[0].variance / unit) * 3600.0, 136.0, 0.5);
  EXPECT_NEAR(1.0 / noise.at_rest.processes[0].beta_per_s, 203.0, 0.5);
  EXPECT_NEAR(std::sqrt(noise.in_motion.processes[0].variance / unit) * 3600.0, 357.0, 0.5);
  EXPECT_NEAR(1.0 / noise.in_motion.processes[0].beta_per_s, 645.0, 0.5);
}

TEST(SensorClasses, TheReferenceHasItsAngularRandomWalkAtAnyRate) {
  Random random(1, "airins");
  const ImuErrors errors = draw_reference(ReferenceClass{}, 100.0, random);
  // 0.0015 deg/sqrt(h) at 100 Hz is 4.4e-6 rad/s a sample.
  EXPECT_NEAR(std::sqrt(errors.gyro.noise[0].at_rest.white_variance), 4.36e-6, 0.01e-6);
  EXPECT_NEAR(std::sqrt(errors.accel.noise[2].in_motion.white_variance), 9.80665e-4, 1e-8);
}

}  // namespace
}  // namespace imusim
