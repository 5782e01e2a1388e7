#include "estimation/batch/stability.h"

#include <gtest/gtest.h>
#include <random>
#include <utility>

#include "estimation/batch/batch_mounting.h"
#include "estimation/navigation/so3.h"
#include "synthetic_pair.h"

namespace {

using imuscope::batch::Change;
using imuscope::batch::kTimeOffset;
using imuscope::batch::largest_change;
using imuscope::batch::WatchedVector;
using imuscope::batch::WindowInfluences;

/// Influences of windows that each tell as much, neighbours sharing half of what they saw.
WindowInfluences influences(Eigen::Index windows, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  WindowInfluences out(windows, imuscope::batch::kWatched);
  for (Eigen::Index c = 0; c < out.cols(); ++c) {
    double before = normal(random);
    for (Eigen::Index w = 0; w < windows; ++w) {
      const double now = normal(random);
      out(w, c) = (before + now) / std::sqrt(2.0 * static_cast<double>(windows));
      before = now;
    }
  }
  return out;
}

/// Of their sum, which is twice that of independent ones.
WatchedVector variance() { return WatchedVector::Constant(2.0); }

TEST(Stability, IsToldInNoneOfAThousandDrivesWhoseWindowsAgree) {
  std::mt19937_64 random(1);
  double largest = 0.0;
  for (int i = 0; i < 1000; ++i)
    largest = std::max(largest, largest_change(influences(150, random), variance()).statistic);
  EXPECT_LT(largest, 5.0);
  EXPECT_GT(largest, 3.0) << "the statistic is one, and not always small";
}

TEST(Stability, FindsWhenAndHowFarTheMountingMoved) {
  std::mt19937_64 random(2);
  for (const Eigen::Index at : {40, 75, 110}) {
    WindowInfluences moved = influences(150, random);
    constexpr double kStep = 40.0;
    // Each window pulls towards its own mounting; the estimate is their mean.
    const double t = static_cast<double>(at) / 150.0;
    for (Eigen::Index w = 0; w < 150; ++w) moved(w, 1) += (w < at ? -kStep * (1.0 - t) : kStep * t) / 150.0;
    const Change change = largest_change(moved, variance());
    EXPECT_TRUE(change.is_told()) << change.statistic;
    EXPECT_NEAR(static_cast<double>(change.window), static_cast<double>(at), 10.0);
    EXPECT_NEAR(change.difference[1], kStep, 11.0);
    EXPECT_NEAR(std::abs(change.reach[1]), std::max(t, 1.0 - t) * kStep, 9.0);
  }
}

/// What is farther from the common mounting fits worse and scatters more: the quiet part knows no less for that.
TEST(Stability, TellsOfAPartThatScattersLittleBesideTheOther) {
  std::mt19937_64 random(6);
  WindowInfluences moved = influences(150, random);
  moved.bottomRows(75) *= 8.0;
  for (Eigen::Index w = 0; w < 150; ++w) moved(w, 1) += (w < 75 ? -400.0 : 400.0) / 150.0;
  const Change change = largest_change(moved, variance());
  EXPECT_TRUE(change.is_told()) << change.statistic;
  EXPECT_NEAR(static_cast<double>(change.window), 75.0, 10.0);
  EXPECT_GT(std::abs(change.reach[1]), 400.0);
}

TEST(Stability, SaysNothingOfAFewWindows) {
  std::mt19937_64 random(3);
  EXPECT_EQ(largest_change(influences(9, random), variance()).statistic, 0.0);
}

/// Turns the S-IMU about its y axis in mid-drive.
Eigen::Matrix3d turn_in_mid_drive(synthetic::Pair& pair, double angle_rad) {
  const Eigen::Matrix3d turn = imuscope::exp_so3(Eigen::Vector3d(0.0, angle_rad, 0.0));
  for (std::size_t i = pair.study.size() / 2; i < pair.study.size(); ++i) {
    pair.study.omega_radps[i] = (turn.cast<float>() * pair.study.omega_radps[i]).eval();
    pair.study.f_mps2[i] = (turn.cast<float>() * pair.study.f_mps2[i]).eval();
  }
  return turn;
}

/// By nine degrees, drives have an estimate that reaches to both mountings; by fourteen, some have none that settles: these
/// are refused for what is wrong, not for telling too little.
TEST(Stability, ASensorThatWasTurnedFarIsToldOrRefusedForThat) {
  int refused = 0;
  for (const auto& [seed, angle_rad] : {std::pair{1U, 0.15}, std::pair{11U, 0.15}, std::pair{18U, 0.15},
                                        std::pair{22U, 0.25}, std::pair{24U, 0.25}}) {
    auto pair = synthetic::make_pair({}, seed);
    turn_in_mid_drive(pair, angle_rad);
    const auto found = imuscope::batch::estimate_mounting(pair.reference, pair.study);
    if (found) {
      EXPECT_TRUE(found->change.is_told()) << "seed " << seed;
      continue;
    }
    ++refused;
    const std::string text = found.error().text();
    EXPECT_NE(text.find("its mounting changes"), std::string::npos) << text;
    EXPECT_TRUE(text.find("cut the recording there") != std::string::npos ||
                text.find("study each half") != std::string::npos)
        << text;
  }
  EXPECT_GT(refused, 0);
}

/// Two records, the S-IMU turned by three degrees in mid-drive.
class MovedSensor : public testing::TestWithParam<std::uint64_t> {};

TEST_P(MovedSensor, GetsAnSdThatReachesBothMountings) {
  synthetic::PairOptions options;
  const auto before = synthetic::make_pair(options, GetParam());
  auto pair = before;
  const Eigen::Matrix3d turn = turn_in_mid_drive(pair, 0.05);
  const auto firm = imuscope::batch::estimate_mounting(before.reference, before.study);
  ASSERT_TRUE(firm);
  EXPECT_FALSE(firm->change.is_told()) << firm->change.statistic;
  const auto found = imuscope::batch::estimate_mounting(pair.reference, pair.study);
  ASSERT_TRUE(found) << found.error().text();
  EXPECT_TRUE(found->change.is_told());
  EXPECT_NEAR(found->change_s, 120.0, 15.0);
  for (const Eigen::Matrix3d& C : {options.C_b_s, Eigen::Matrix3d(turn * options.C_b_s)}) {
    const Eigen::Vector3d error = imuscope::log_so3(found->sensor.C_b_s.transpose() * C);
    EXPECT_LT(std::abs(error.y()), 2.0 * found->sd(imuscope::batch::kPsi, 1));
  }
}

INSTANTIATE_TEST_SUITE_P(Stability, MovedSensor, testing::Values(5, 7, 8, 19));

TEST(Stability, AClockThatJumpsIsRefused) {
  auto pair = synthetic::make_pair({}, 6);
  for (double& time : pair.study.time_s)
    if (time > 120.0) time += 0.1;
  const auto found = imuscope::batch::estimate_mounting(pair.reference, pair.study);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().kind, imuscope::ErrorKind::kUsage);
  EXPECT_NE(found.error().text().find("jumps"), std::string::npos) << found.error().text();
}

}  // namespace
