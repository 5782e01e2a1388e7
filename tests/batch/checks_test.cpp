#include "batch/checks.h"

#include <gtest/gtest.h>

#include "batch/batch_mounting.h"
#include "navigation/so3.h"
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

TEST(FindStart, TellsAMirroredAxis) {
  PairOptions options;
  options.motion = 2.0;
  Pair pair = pair_of(options);
  // The road's slow turns alone are about one axis, which no mirror shows: here all three are turned about.
  for (std::size_t i = 0; i < pair.reference.size(); ++i) {
    const double t = pair.reference.time_s[i];
    pair.reference.omega_radps[i] +=
        Eigen::Vector3d(0.3 * std::sin(1.1 * t), 0.3 * std::sin(1.7 * t), 0.0).cast<float>();
  }
  for (std::size_t i = 0; i < pair.study.size(); ++i) {
    const double t = pair.study.time_s[i] + options.t_d_s;
    pair.study.omega_radps[i] +=
        Eigen::Vector3d(0.3 * std::sin(1.1 * t), 0.3 * std::sin(1.7 * t), 0.0).cast<float>();
    pair.study.omega_radps[i].y() *= -1.0F;
  }
  expect_wrong(pair, "mirror");
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

TEST(FindStart, AsksForMoreThanAFewSeconds) {
  PairOptions options;
  options.duration_s = 15.0;
  const Pair pair = make_pair(options, 3);
  EXPECT_FALSE(find_start(pair.reference, pair.study, 3.0));
  EXPECT_FALSE(find_start({}, pair.study, 3.0));
}

}  // namespace
