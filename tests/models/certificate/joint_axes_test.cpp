#include "models/certificate/joint_axes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <random>

namespace imuscope::certificate {
namespace {

constexpr std::size_t kSamples = 1U << 15U;
constexpr double kRate_hz = 100.0;
/// Own white noise of three S-IMUs, and that of the reference which they share.
constexpr std::array<double, 3> kOwn{1.0, 1.5, 3.0};
constexpr double kCommon = 0.8;

std::vector<std::vector<double>> sensors_on_one_reference(unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<std::vector<double>> all(kOwn.size(), std::vector<double>(kSamples));
  for (std::size_t t = 0; t < kSamples; ++t) {
    const double common = kCommon * normal(random);
    for (std::size_t i = 0; i < kOwn.size(); ++i) all[i][t] = common + kOwn[i] * normal(random);
  }
  return all;
}

std::vector<JointSignal> signals_of(const std::vector<std::vector<double>>& values) {
  std::vector<JointSignal> signals;
  for (const auto& one : values) signals.push_back({"mtx" + std::to_string(signals.size() + 1), one});
  return signals;
}

/// Of white noise the wavelet variance at the first scale is half of a sample's variance.
TEST(JointAxes, TellApartWhatIsCommonAndWhatIsEachOnesOwn) {
  const auto values = sensors_on_one_reference(3);
  const auto joint = joint_axes(signals_of(values), {.rate_hz = kRate_hz});
  ASSERT_TRUE(joint) << joint.error().text();
  EXPECT_EQ(joint->samples, kSamples);
  EXPECT_EQ(joint->rate_hz, kRate_hz);
  const JointScale& first = joint->scales.front();
  EXPECT_DOUBLE_EQ(first.tau_s, 0.02) << "two samples";
  EXPECT_NEAR(first.common.value, 0.5 * kCommon * kCommon, 0.03);
  EXPECT_LT(first.common.ci_low, 0.5 * kCommon * kCommon);
  EXPECT_GT(first.common.ci_high, 0.5 * kCommon * kCommon);
  for (std::size_t i = 0; i < kOwn.size(); ++i) {
    EXPECT_NEAR(first.own[i].value, 0.5 * kOwn[i] * kOwn[i], 0.1 * kOwn[i] * kOwn[i]) << i;
    EXPECT_NEAR(first.variance[i], first.common.value + first.own[i].value, 0.03 * first.variance[i]) << i;
  }
}

/// The best mean weighs with the inverse of each one's own variance; what is common stays in it.
TEST(JointAxes, TheQuietestMeanWeighsByTheInverseOfEachOnesOwnVariance) {
  const auto values = sensors_on_one_reference(4);
  const auto joint = joint_axes(signals_of(values), {.rate_hz = kRate_hz, .from_s = 0.02, .to_s = 0.1});
  ASSERT_TRUE(joint) << joint.error().text();
  double inverse = 0.0;
  for (const double own : kOwn) inverse += 1.0 / (own * own);
  ASSERT_EQ(joint->weights.size(), kOwn.size());
  EXPECT_NEAR(std::accumulate(joint->weights.begin(), joint->weights.end(), 0.0), 1.0, 1e-12);
  for (std::size_t i = 0; i < kOwn.size(); ++i)
    EXPECT_NEAR(joint->weights[i], 1.0 / (kOwn[i] * kOwn[i] * inverse), 0.05) << i;
  EXPECT_DOUBLE_EQ(joint->from_s, 0.02);
  EXPECT_DOUBLE_EQ(joint->to_s, 0.08) << "the longest of a power of two samples up to 0.1 s";
  const double best = std::sqrt(kCommon * kCommon + 1.0 / inverse);
  const double alone = std::hypot(kCommon, kOwn[0]);
  EXPECT_NEAR(joint->ratio, best / alone, 0.02);
  EXPECT_NEAR(joint->held_out, best / alone, 0.04);
}

TEST(JointAxes, WhatIsMissingInOneIsMissingInAll) {
  auto values = sensors_on_one_reference(5);
  for (std::size_t t = 100; t < 400; ++t) values[t % 3][t] = std::numeric_limits<double>::quiet_NaN();
  const auto joint = joint_axes(signals_of(values), {.rate_hz = kRate_hz});
  ASSERT_TRUE(joint) << joint.error().text();
  EXPECT_EQ(joint->samples, kSamples - 300);
}

TEST(JointAxes, ScalesThatAreWorthTooLittleAreRefusedWithWhatToDo) {
  const auto values = sensors_on_one_reference(6);
  const auto joint = joint_axes(signals_of(values), {.rate_hz = kRate_hz, .from_s = 50.0});
  ASSERT_FALSE(joint);
  EXPECT_THAT(joint.error().text(), testing::AllOf(testing::HasSubstr("no scale between 50 and"),
                                                   testing::HasSubstr("200 independent squares"),
                                                   testing::HasSubstr("327.68 s are there")));
}

TEST(JointAxes, AxesOfOneSensorHaveCoherenceButNoMean) {
  auto values = sensors_on_one_reference(7);
  const auto joint = joint_axes(signals_of(values), {.rate_hz = kRate_hz, .share_a_reference = false});
  ASSERT_TRUE(joint) << joint.error().text();
  EXPECT_TRUE(joint->weights.empty());
  ASSERT_EQ(joint->pairs.size(), 3U);
  const double expected = kCommon * kCommon / std::hypot(kCommon, kOwn[0]) / std::hypot(kCommon, kOwn[1]);
  EXPECT_NEAR(joint->pairs[0].coherence.value, expected, 0.1);
  EXPECT_TRUE(joint->pairs[0].shows());
  EXPECT_LT(joint->pairs[0].p_holm, 1e-6);
}

}  // namespace
}  // namespace imuscope::certificate
