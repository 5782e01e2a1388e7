#include "estimation/batch/checks.h"

#include <gtest/gtest.h>

#include "base/units.h"
#include "estimation/batch/batch_mounting.h"
#include "estimation/navigation/so3.h"
#include "synthetic_pair.h"

namespace {

using imuscope::ErrorKind;
using imuscope::batch::estimate_mounting;
using imuscope::batch::find_start;
using imuscope::batch::ImuRecord;
using synthetic::make_pair;
using synthetic::Pair;
using synthetic::PairOptions;

Pair pair_of(PairOptions options = {}) {
  options.duration_s = 60.0;
  return make_pair(options, 3);
}

TEST(FindStart, IsGoodToADegreeAndAFewMillisecondsInAnyMounting) {
  for (const Eigen::Vector3d& turn :
       {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(3.1, 0, 0), Eigen::Vector3d(0.5, -2, 1)}) {
    PairOptions options;
    options.C_b_s = imuscope::exp_so3(turn);
    const Pair pair = pair_of(options);
    const auto start = find_start(pair.reference, pair.study, 3.0);
    ASSERT_TRUE(start) << start.error().text();
    EXPECT_LT(imuscope::log_so3(start->C_b_s.transpose() * options.C_b_s).norm(), 0.02);
    EXPECT_NEAR(start->time_offset_s, options.t_d_s, 0.005);
    EXPECT_GT(start->rate_correlation, 0.99);
  }
}

/// Far from the reference, a body that shakes feels its own forces: several times what braking makes.
TEST(FindStart, FindsABodyThatShakesHardOnALongLeverArm) {
  PairOptions options;
  options.hop_rate = 0.02;
  options.r_bs_b_m = {1.5, -0.8, 0.6};
  const Pair pair = pair_of(options);
  const auto start = find_start(pair.reference, pair.study, 3.0);
  ASSERT_TRUE(start) << start.error().text();
  EXPECT_LT(imuscope::log_so3(start->C_b_s.transpose() * options.C_b_s).norm(), 0.02);
}

/// Each must be refused as wrong, in words that name it; none may become a mounting.
void expect_wrong(const Pair& pair, const std::string& words) {
  const auto found = estimate_mounting(pair.reference, pair.study);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().kind, ErrorKind::kUsage);
  EXPECT_NE(found.error().text().find(words), std::string::npos) << found.error().text();
}

TEST(FindStart, TellsDegreesTakenForRadians) {
  Pair pair = pair_of();
  for (auto& omega : pair.study.omega_radps) omega *= 57.29578F;
  expect_wrong(pair, "gyro_unit");
  for (auto& omega : pair.study.omega_radps) omega /= 57.29578F * 57.29578F;
  expect_wrong(pair, "gyro_unit");
}

/// The S-IMU's triads through matrices that need not be rotations.
Pair changed(const Eigen::Matrix3f& gyro, const Eigen::Matrix3f& accel) {
  Pair pair = pair_of();
  for (auto& omega : pair.study.omega_radps) omega = (gyro * omega).eval();
  for (auto& f : pair.study.f_mps2) f = (accel * f).eval();
  return pair;
}

const Eigen::Matrix3f kSame = Eigen::Matrix3f::Identity();
Eigen::Matrix3f mirror(Eigen::Index axis) {
  Eigen::Matrix3f m = kSame;
  m(axis, axis) = -1.0F;
  return m;
}
Eigen::Matrix3f swapped_x_and_y() {
  Eigen::Matrix3f m;
  m << 0, 1, 0, 1, 0, 0, 0, 0, 1;
  return m;
}

TEST(FindStart, TellsAMirroredAxisInEitherTriadOrBoth) {
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    SCOPED_TRACE(axis);
    expect_wrong(changed(mirror(axis), mirror(axis)), "rates are a mirror image");
    expect_wrong(changed(mirror(axis), kSame), "rates are a mirror image");
    expect_wrong(changed(kSame, mirror(axis)), "forces are a mirror image");
  }
  expect_wrong(changed(swapped_x_and_y(), kSame), "rates are a mirror image");
  expect_wrong(changed(kSame, swapped_x_and_y()), "forces are a mirror image");
  expect_wrong(changed(kSame, -kSame), "upside down");
}

TEST(FindStart, TellsAccelerometersThatAreTurnedAgainstTheGyros) {
  // By 90 degrees about each axis; about the vertical no gravity tells it.
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    SCOPED_TRACE(axis);
    const Eigen::Matrix3f turn =
        imuscope::exp_so3(Eigen::Vector3d::Unit(axis) * 1.5707963267948966).cast<float>();
    expect_wrong(changed(kSame, turn), "90 deg apart");
    expect_wrong(changed(turn, kSame), "90 deg apart");
    EXPECT_TRUE(find_start(changed(turn, turn).reference, changed(turn, turn).study, 3.0));
  }
}

TEST(FindStart, TellsForcesInGAndForcesWithoutGravity) {
  expect_wrong(changed(kSame, kSame / 9.80665F), "they are in g");
  Pair pair = pair_of();
  for (auto& f : pair.reference.f_mps2) f /= 9.80665F;
  expect_wrong(pair, "the reference's forces are");
  expect_wrong(pair, "they are in g");
  pair = pair_of();
  for (auto& f : pair.study.f_mps2) f.z() += 9.81F;
  expect_wrong(pair, "forces without gravity");
}

TEST(FindStart, TakesABodyThatIsLaidOnItsSidesForOneUnderGravity) {
  PairOptions options;
  options.laid_on_sides = true;
  options.C_b_s = imuscope::exp_so3(Eigen::Vector3d(0.5, -0.7, 1.6));
  Pair pair = make_pair(options, 3);
  const auto start = find_start(pair.reference, pair.study, 3.0);
  ASSERT_TRUE(start) << start.error().text();
  EXPECT_LT(imuscope::log_so3(start->C_b_s * options.C_b_s.transpose()).norm(), 1.0 * imuscope::kRadPerDeg);
  for (auto& f : pair.study.f_mps2) f /= 9.80665F;
  expect_wrong(pair, "they are in g");
}

TEST(FindStart, TellsAnAxisThatShowsOneNumber) {
  Pair pair = pair_of();
  for (auto& omega : pair.study.omega_radps) omega.y() = 0.25F;
  expect_wrong(pair, "its gyro y shows 0.25 throughout");
  pair = pair_of();
  for (auto& f : pair.reference.f_mps2) f.x() = 0.0F;
  expect_wrong(pair, "the reference's accelerometer x shows 0 throughout");
}

TEST(FindStart, TakesNoiseAtRestForNoDifferenceOfUnits) {
  PairOptions options;
  options.motion = 0.0;
  options.study_gyro_white = 3e-3;
  const Pair pair = pair_of(options);
  const auto found = find_start(pair.reference, pair.study, 3.0);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().kind, ErrorKind::kWork) << found.error().text();
}

TEST(FindStart, TellsACopyOfTheReference) {
  const Pair pair = pair_of();
  expect_wrong({pair.reference, pair.reference}, "copy");
}

TEST(FindStart, FindsNothingWhereTheSensorIsOnAnotherBody) {
  const Pair one = pair_of();
  PairOptions options;
  options.duration_s = 60.0;
  const Pair other = make_pair(options, 4);
  EXPECT_FALSE(estimate_mounting(one.reference, other.study));
}

TEST(FindStart, FindsNothingWhereTheBodyNeverTurns) {
  PairOptions options;
  options.turns = false;
  const auto found = estimate_mounting(pair_of(options).reference, pair_of(options).study);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().kind, ErrorKind::kWork);
}

TEST(FindStart, AsksForMoreThanThirtySeconds) {
  PairOptions options;
  options.duration_s = 40.0;
  const Pair pair = make_pair(options, 3);
  EXPECT_FALSE(find_start(pair.reference, pair.study, 3.0));
  EXPECT_FALSE(find_start({}, pair.study, 3.0));
}

}  // namespace
