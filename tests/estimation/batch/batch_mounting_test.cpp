#include "estimation/batch/batch_mounting.h"

#include <gtest/gtest.h>
#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <random>
#include <utility>

#include "base/units.h"
#include "estimation/navigation/so3.h"
#include "synthetic_pair.h"

namespace {

using imuscope::batch::BatchMounting;
using imuscope::batch::estimate_mounting;
using namespace imuscope::batch;
using synthetic::make_pair;
using synthetic::PairOptions;
using Vector6 = Eigen::Matrix<double, 6, 1>;

Vector6 error_of(const BatchMounting& found, const PairOptions& truth) {
  Vector6 error;
  error << -imuscope::log_so3(found.sensor.C_b_s.transpose() * truth.C_b_s),
      truth.r_bs_b_m - found.sensor.lever_arm_b_m();
  return error;
}

double nees(const BatchMounting& found, const PairOptions& truth) {
  const Vector6 error = error_of(found, truth);
  return error.dot(found.covariance.topLeftCorner<6, 6>().ldlt().solve(error));
}

/// Every component of boresight and lever arm.
void expect_within_its_sd(const BatchMounting& found, const PairOptions& truth) {
  const Vector6 error = error_of(found, truth);
  for (Eigen::Index i = 0; i < 6; ++i)
    EXPECT_LT(std::abs(error[i]), 4.0 * std::sqrt(found.covariance(i, i))) << i;
}

/// A sensor of the class that the priors are made for, crooked in every way that they know.
PairOptions crooked() {
  PairOptions options;
  options.C_b_s = imuscope::exp_so3(Eigen::Vector3d(0.02, -0.03, 1.6));
  options.gyro_matrix << 1.004, 0, 0, 0.0015, 0.997, 0, -0.0020, 0.0012, 1.002;
  options.accel_matrix << 0.998, 0, 0, -0.0011, 1.003, 0, 0.0008, 0.0017, 0.996;
  options.accel_matrix =
      (options.accel_matrix * imuscope::exp_so3(Eigen::Vector3d(0.002, -0.0015, 0.001))).eval();
  options.accel_delay_s = 0.0008;
  options.clock_rate = 8e-6;
  return options;
}

TEST(EstimateMounting, FindsACrookedSensorWithinItsSd) {
  const PairOptions truth = crooked();
  const auto pair = make_pair(truth, 1);
  const auto found = estimate_mounting(pair.reference, pair.study);
  ASSERT_TRUE(found) << found.error().text();
  expect_within_its_sd(*found, truth);
  EXPECT_LT(found->sd(kPsi, 2), 0.002);
  EXPECT_LT(found->sd(kTimeOffset), 5e-4);
  const auto near = [&](double value, double expected, double sd) { EXPECT_NEAR(value, expected, 4.0 * sd); };
  near(found->sensor.x[kTimeOffset], truth.t_d_s, found->sd(kTimeOffset));
  near(found->sensor.x[kClockRate], truth.clock_rate, found->sd(kClockRate));
  near(found->sensor.x[kAccelDelay], truth.accel_delay_s, found->sd(kAccelDelay));
  near(found->sensor.gyro_shape()(2, 2), truth.gyro_matrix(2, 2), found->sd(kGyroShape, 2));
  near(found->sensor.gyro_shape()(2, 0), truth.gyro_matrix(2, 0), found->sd(kGyroShape, 4));
  const Eigen::Matrix3d accel = found->sensor.accel_shape() * found->sensor.C_s_accel();
  near(accel(0, 0), truth.accel_matrix(0, 0), found->sd(kAccelShape, 0) + found->sd(kAlpha));
  for (Eigen::Index i = 0; i < 3; ++i)
    near(found->sensor.x[kGyroBias + i], truth.gyro_bias[i], found->sd(kGyroBias, i));
}

/// Without a drive: what a bench has, or a user who turns the vehicle's sensor plate by hand.
TEST(EstimateMounting, FindsACrookedSensorThatIsLaidOnItsSidesWithinItsSd) {
  PairOptions truth = crooked();
  truth.laid_on_sides = true;
  truth.reference_gyro_white = 1e-6;  // navigation grade, whose own axes limit nothing
  truth.reference_accel_white = 1e-4;
  constexpr int kRecords = 4;
  double sum = 0.0;
  for (std::uint64_t seed = 1; seed <= kRecords; ++seed) {
    const auto pair = make_pair(truth, seed);
    const auto found = estimate_mounting(pair.reference, pair.study);
    ASSERT_TRUE(found) << found.error().text();
    expect_within_its_sd(*found, truth);
    sum += nees(*found, truth);
    // All axes turn, and gravity comes along each: what is left is the reference's own axes, not the class's 0.05 deg.
    for (Eigen::Index i = 3; i < 6; ++i)
      EXPECT_LT(found->sd(kAccelShape, i), 0.5 * 0.05 * imuscope::kRadPerDeg) << i;
    EXPECT_NEAR(found->sensor.gyro_shape()(2, 0), truth.gyro_matrix(2, 0), 4.0 * found->sd(kGyroShape, 4));
  }
  EXPECT_LT(sum / kRecords, 6.0 + 4.0 * std::sqrt(12.0 / kRecords));
}

/// B-21, against estimates from references that are off by each error in turn.
TEST(EstimateMounting, KnowsWhatTheReferencesOwnAxesMakeOfIt) {
  BatchOptions options;
  options.reference_gyro_white_radps_per_sqrt_hz = 0.3 * imuscope::kRadPerDeg / 60.0;
  const imuscope::ReferenceGrade grade =
      imuscope::reference_grade(*options.reference_gyro_white_radps_per_sqrt_hz);
  const auto found_with = [&](const Eigen::Matrix3d& gyro, const Eigen::Matrix3d& accel) {
    PairOptions pair_options = crooked();
    pair_options.reference_gyro_matrix += gyro;
    pair_options.reference_accel_matrix += accel;
    const auto pair = make_pair(pair_options, 11);
    auto found = estimate_mounting(pair.reference, pair.study, options);
    EXPECT_TRUE(found);
    return *found;
  };
  const Eigen::Matrix3d none = Eigen::Matrix3d::Zero();
  const BatchMounting straight = found_with(none, none);
  for (Eigen::Index i = 0; i < 3; ++i) {
    const Eigen::Index j = (i + 1) % 3;
    Eigen::Matrix3d scale = none;
    scale(i, i) = grade.scale_sd;
    Eigen::Matrix3d lean = none;
    lean(i, j) = lean(j, i) = grade.lean_sd_rad;
    const Eigen::Matrix3d turn = imuscope::skew(grade.triad_sd_rad * Eigen::Vector3d::Unit(i));
    const std::array<std::pair<Eigen::Matrix3d, Eigen::Matrix3d>, 5> errors{
        {{scale, none}, {none, scale}, {lean, none}, {none, lean}, {none, turn}}};
    for (Eigen::Index kind = 0; kind < 5; ++kind) {
      const auto& [gyro, accel] = errors[static_cast<std::size_t>(kind)];
      const BatchMounting off = found_with(gyro, accel);
      Vector6 moved;
      moved << imuscope::log_so3(off.sensor.C_b_s.transpose() * straight.sensor.C_b_s),
          off.sensor.lever_arm_b_m() - straight.sensor.lever_arm_b_m();
      const Vector6 said = straight.shared.col(kParameters + 5 * i + kind);
      const Vector6 sd = straight.covariance.topLeftCorner<6, 6>().diagonal().cwiseSqrt();
      for (Eigen::Index k = 0; k < 6; ++k)
        EXPECT_NEAR(moved[k], said[k], 0.15 * std::abs(said[k]) + 0.1 * sd[k])
            << i << " " << kind << " " << k;
    }
  }
}

/// Scale and axes as a data sheet of an industrial MEMS unit has them: 0.5 %, 0.1 deg between two axes.
Eigen::Matrix3d crooked_mems(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();
  for (Eigen::Index i = 0; i < 3; ++i)
    for (Eigen::Index j = 0; j < 3; ++j) matrix(i, j) += (i == j ? 5e-3 : 1.24e-3) * normal(random);
  return matrix;
}

/// Where the reference is as noisy as the S-IMU, least squares on its rates and their derivative attenuate; and
/// its axes are as crooked.
TEST(EstimateMounting, IsUnbiasedWhereTheReferenceIsAsNoisyAsTheSensor) {
  Vector6 sum = Vector6::Zero();
  Vector6 variance = Vector6::Zero();
  double total = 0.0;
  std::mt19937_64 random(5);
  constexpr int kSeeds = 8;
  for (int seed = 0; seed < kSeeds; ++seed) {
    PairOptions truth = crooked();
    truth.reference_gyro_white = truth.study_gyro_white = 4e-4;  // 1 deg/sqrt(h)
    truth.reference_accel_white = truth.study_accel_white = 5e-3;
    truth.reference_gyro_matrix = crooked_mems(random);
    truth.reference_accel_matrix = crooked_mems(random);
    const auto pair = make_pair(truth, 100 + static_cast<std::uint64_t>(seed));
    const auto found = estimate_mounting(pair.reference, pair.study);
    ASSERT_TRUE(found) << found.error().text();
    EXPECT_TRUE(found->settled) << seed;
    sum += error_of(*found, truth);
    variance += found->covariance.diagonal().head<6>();
    total += nees(*found, truth);
  }
  for (Eigen::Index i = 0; i < 6; ++i) EXPECT_LT(std::abs(sum[i]), 3.3 * std::sqrt(variance[i])) << i;
  // Chi-square of 6 * kSeeds degrees of freedom: 3.3 sd about its mean, widened for sd that are estimates.
  const double sd = std::sqrt(2.0 * 6.0 * kSeeds) * 1.15;
  EXPECT_NEAR(total, 6.0 * kSeeds, 3.3 * sd);
}

/// What looks like a hundredth of the S-IMU's gyro noise in the reference is, a metre away and at some Hz, more
/// than its accelerometers show: a perfect reference has to be found to be one, or the lever arm runs away.
TEST(EstimateMounting, StaysAtTheLeverArmOfQuietAccelerometersFarFromAPerfectReference) {
  double total = 0.0;
  constexpr int kSeeds = 6;
  for (int seed = 0; seed < kSeeds; ++seed) {
    PairOptions truth = crooked();
    truth.r_bs_b_m = {0.99, -0.35, 0.45};
    truth.road_rate = 2e-3;
    truth.reference_gyro_white = 1e-7;
    truth.reference_accel_white = 1e-5;
    truth.study_gyro_white = 1.2e-3;  // 3 deg/sqrt(h)
    truth.study_accel_white = 1.6e-3;
    const auto pair = make_pair(truth, 300 + static_cast<std::uint64_t>(seed));
    const auto found = estimate_mounting(pair.reference, pair.study);
    ASSERT_TRUE(found) << found.error().text();
    SCOPED_TRACE(seed);
    expect_within_its_sd(*found, truth);
    EXPECT_LT(found->sd(kLeverArm, 2), 0.01);
    total += nees(*found, truth);
  }
  EXPECT_LT(total, 6.0 * kSeeds + 3.3 * std::sqrt(2.0 * 6.0 * kSeeds));
}

/// Its squares are slow: who leaves them out takes a lever arm for longer than it is.
TEST(EstimateMounting, IsNotMisledByABodyThatShakesFasterThanTheGridShows) {
  PairOptions truth = crooked();
  truth.r_bs_b_m = {0.2, -0.5, 0.9};
  truth.hop_rate = 0.015;
  truth.study_accel_white = 1e-3;
  truth.reference_gyro_white = 1e-6;
  const auto pair = make_pair(truth, 320);
  const auto found = estimate_mounting(pair.reference, pair.study);
  ASSERT_TRUE(found) << found.error().text();
  expect_within_its_sd(*found, truth);
  EXPECT_LT(error_of(*found, truth).tail<3>().norm(), 0.003);
  BatchOptions leaves_out;
  leaves_out.sensor.shaking_sd_m = 1e-6;
  const auto misled = estimate_mounting(pair.reference, pair.study, leaves_out);
  ASSERT_TRUE(misled);
  EXPECT_GT(error_of(*misled, truth).tail<3>().norm(), 0.01);
}

/// A second-order low-pass is later for fast motion than for slow.
TEST(EstimateMounting, TellsALowPassFromADelay) {
  for (int seed = 0; seed < 3; ++seed) {
    PairOptions truth = crooked();
    truth.road_rate = 5e-3;
    truth.study_low_pass_hz = 40.0;
    truth.reference_gyro_white = 2e-5;
    const auto pair = make_pair(truth, 330 + static_cast<std::uint64_t>(seed));
    const auto found = estimate_mounting(pair.reference, pair.study);
    ASSERT_TRUE(found) << found.error().text();
    const double t_d_s = truth.t_d_s - synthetic::low_pass_delay_s(truth.study_low_pass_hz);
    EXPECT_NEAR(found->sensor.x[kTimeOffset], t_d_s, 3.3 * found->sd(kTimeOffset)) << seed;
    EXPECT_LT(found->sd(kTimeOffset), 6e-5) << seed;
    // Phase of 1 / (1 + i sqrt(2) u - u^2) at u = 5 Hz / 40 Hz, less that of slow motion's delay: 29.0 us at 5 Hz.
    for (Eigen::Index triad = 0; triad < 2; ++triad)
      EXPECT_NEAR(found->sensor.x[kDispersion + triad], -29.0e-6, 4.0 * found->sd(kDispersion, triad))
          << seed << ' ' << triad;
    EXPECT_LT(found->sd(kDispersion, 1), 8e-6) << seed;
  }
}

/// Forces of the lever arm are made of the reference's rates, and come with their delay.
TEST(EstimateMounting, TellsTheReferencesTriadsApartInTime) {
  for (int seed = 0; seed < 3; ++seed) {
    PairOptions truth = crooked();
    truth.road_rate = 1e-2;
    truth.reference_accel_delay_s = 5e-4;
    truth.reference_gyro_white = 2e-5;
    const auto pair = make_pair(truth, 340 + static_cast<std::uint64_t>(seed));
    const auto found = estimate_mounting(pair.reference, pair.study);
    ASSERT_TRUE(found) << found.error().text();
    const auto near = [&](Parameter of, double value) {
      EXPECT_NEAR(found->sensor.x[of], value, 3.3 * found->sd(of)) << "seed " << seed << ", parameter " << of;
      EXPECT_LT(found->sd(of), 1e-4);
    };
    near(kTimeOffset, truth.t_d_s);
    near(kReferenceAccelDelay, -truth.reference_accel_delay_s);
    // Both IMUs' accelerometers against one another: the reference's are late.
    near(kAccelDelay, truth.accel_delay_s + truth.reference_accel_delay_s);
    EXPECT_LT(nees(*found, truth), 22.5);  // one of a thousand
  }
}

/// A noisy reference on a road that makes the body roll and pitch up to 9 Hz, but not yaw: what its z gyro shows there is
/// noise, and its derivative more so.
TEST(EstimateMounting, TakesNoNoiseForYawOnAnUnevenRoad) {
  double total = 0.0;
  constexpr int kSeeds = 4;
  for (int seed = 0; seed < kSeeds; ++seed) {
    PairOptions truth = crooked();
    truth.road_rate = 8e-3;
    truth.reference_gyro_white = truth.study_gyro_white = 2e-3;  // 4.8 deg/sqrt(h)
    const auto pair = make_pair(truth, 350 + static_cast<std::uint64_t>(seed));
    const auto found = estimate_mounting(pair.reference, pair.study);
    ASSERT_TRUE(found) << found.error().text();
    EXPECT_LT(error_of(*found, truth).tail<3>().cwiseAbs().maxCoeff(), 0.05) << seed;
    total += nees(*found, truth);
  }
  EXPECT_LT(total, 6.0 * kSeeds + 3.3 * std::sqrt(2.0 * 6.0 * kSeeds));
}

TEST(EstimateMounting, RefusesAnAxisThatIsNoSensorsByName) {
  for (const bool of_reference : {false, true}) {
    PairOptions truth = crooked();
    truth.C_b_s.setIdentity();
    Eigen::Matrix3d& matrix = of_reference ? truth.reference_accel_matrix : truth.accel_matrix;
    matrix.row(1) *= 0.5;
    const auto pair = make_pair(truth, 21);
    const auto found = estimate_mounting(pair.reference, pair.study);
    ASSERT_FALSE(found);
    EXPECT_NE(
        found.error().what.find(of_reference ? "accelerometer y shows 2.0" : "accelerometer y shows 0.5"),
        std::string::npos)
        << found.error().text();
  }
}

/// A bracket that gives way turns the sensor wherever the vehicle brakes and turns.
TEST(EstimateMounting, KnowsAMountThatTurnsUnderForces) {
  PairOptions truth = crooked();
  truth.compliance_b << -8e-5, 3e-5, 4e-5, -2e-5, 9e-5, -4e-5, -1e-5, 2e-5, 4e-5;
  for (const double reference_white : {1e-7, 1e-4}) {
    truth.reference_gyro_white = reference_white;
    const auto pair = make_pair(truth, 12);
    const auto found = estimate_mounting(pair.reference, pair.study);
    ASSERT_TRUE(found) << found.error().text();
    expect_within_its_sd(*found, truth);
    const Eigen::Matrix3d compliance_s = truth.C_b_s * truth.compliance_b * truth.C_b_s.transpose();
    for (Eigen::Index i = 0; i < 9; ++i) {
      EXPECT_NEAR(found->sensor.compliance()(i / 3, i % 3), compliance_s(i / 3, i % 3),
                  4.0 * found->sd(kCompliance, i))
          << i;
    }
    EXPECT_LT(found->sd(kCompliance), 2e-5);
  }
}

TEST(EstimateMounting, LosesLittleWithSingleLostSamples) {
  PairOptions truth = crooked();
  const auto whole = make_pair(truth, 5);
  truth.lost_share = 0.01;
  const auto holed = make_pair(truth, 5);
  const auto with = estimate_mounting(whole.reference, whole.study);
  const auto without = estimate_mounting(holed.reference, holed.study);
  ASSERT_TRUE(with);
  ASSERT_TRUE(without);
  EXPECT_GE(without->windows + 2, with->windows);
  const Vector6 difference = error_of(*without, truth) - error_of(*with, truth);
  for (Eigen::Index i = 0; i < 6; ++i)
    EXPECT_LT(std::abs(difference[i]), 1.5 * std::sqrt(with->covariance(i, i))) << i;
}

TEST(EstimateMounting, SaysThatItKnowsLittleAfterHalfAMinuteOfLittleMotion) {
  PairOptions truth = crooked();
  truth.duration_s = 35.0;
  truth.motion = 0.05;
  const auto pair = make_pair(truth, 6);
  const auto found = estimate_mounting(pair.reference, pair.study);
  if (!found) return;
  EXPECT_GT(found->sd(kLeverArm, 0), 0.02);
  EXPECT_LT(nees(*found, truth), 30.0);  // 0.9999 of a chi-square of 6 degrees of freedom
}

TEST(EstimateMounting, SeesWhetherTheAccelerometersAreInOnePlace) {
  PairOptions truth = crooked();
  truth.study_accel_white = truth.reference_accel_white = 2e-4;
  truth.motion = 3.0;
  const auto one = make_pair(truth, 8);
  truth.places_s_m << 0.012, 0.0, 0.004, -0.012, 0.008, 0.0, 0.0, -0.008, -0.004;
  const auto three = make_pair(truth, 8);
  const auto found_one = estimate_mounting(one.reference, one.study);
  const auto found_three = estimate_mounting(three.reference, three.study);
  ASSERT_TRUE(found_one);
  ASSERT_TRUE(found_three);
  EXPECT_TRUE(found_one->one_chip);
  EXPECT_FALSE(found_three->one_chip);
  EXPECT_LT(nees(*found_three, truth), 30.0);
}

TEST(EstimateMounting, GivesTheSameBitsTwice) {
  const auto pair = make_pair(crooked(), 9);
  const auto first = estimate_mounting(pair.reference, pair.study);
  const auto second = estimate_mounting(pair.reference, pair.study);
  ASSERT_TRUE(first);
  ASSERT_TRUE(second);
  EXPECT_EQ(first->sensor.x, second->sensor.x);
  EXPECT_EQ(first->covariance, second->covariance);
}

}  // namespace
