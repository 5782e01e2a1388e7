#include "estimation/alignment/cross_correlation.h"

#include <gtest/gtest.h>
#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "base/units.h"
#include "tests/estimation/alignment/analytic_motion.h"

namespace imuscope {
namespace {

struct Series {
  std::vector<double> time_s, rate;
  [[nodiscard]] RateMagnitudeSeries view() const { return {time_s, rate}; }
};

/// |omega| with white noise on each axis; sample k is taken at t_true = start + k/rate_hz and stamped
/// `stamp(t)`.
template <typename Stamp>
Series recorded(const test::SineSum& omega, double start_s, double end_s, double rate_hz, double noise_radps,
                unsigned seed, Stamp stamp) {
  std::mt19937 random(seed);
  std::normal_distribution<> normal(0.0, noise_radps);
  Series out;
  for (int k = 0; start_s + k / rate_hz < end_s; ++k) {
    const double t = start_s + k / rate_hz;
    const Eigen::Vector3d w = omega(t) + Eigen::Vector3d{normal(random), normal(random), normal(random)};
    out.time_s.push_back(stamp(t));
    out.rate.push_back(w.norm());
  }
  return out;
}

constexpr double kMtxNoise_radps = 0.8 * kRadPerDeg;

TEST(TimeOffset, IsFoundWithinThirtySecondsEitherWay) {
  const test::SineSum omega = test::car_rates(40);
  const Series reference = recorded(omega, 0.0, 300.0, 100.0, 1e-5, 1, [](double t) { return t; });
  for (const double offset : {-28.4, -3.217, 0.0, 0.0042, 1.5, 29.3}) {
    const Series study =
        recorded(omega, 40.0, 250.0, 120.0, kMtxNoise_radps, 2, [&](double t) { return t - offset; });
    const Result<TimeOffset> found = find_time_offset(reference.view(), study.view());
    ASSERT_TRUE(found.has_value()) << found.error().text();
    EXPECT_NEAR(found->offset_s + found->clock_rate * 105.0, offset, 0.004)
        << "in the middle of the recording";
    EXPECT_GT(found->distinctness, 1.2);
    EXPECT_GT(found->sd_s, 0.0);
  }
}

TEST(TimeOffset, AClockRateIsFoundToo) {
  const test::SineSum omega = test::car_rates(41);
  const Series reference = recorded(omega, 0.0, 900.0, 100.0, 1e-5, 3, [](double t) { return t; });
  for (const double rate : {-100e-6, 200e-6}) {
    // t_R = t_S + offset + rate * (t_S - origin).
    const Series study = recorded(omega, 20.0, 880.0, 100.0, kMtxNoise_radps, 4,
                                  [&](double t) { return 20.0 + (t - 20.0) / (1.0 + rate) - 1.25; });
    const Result<TimeOffset> found = find_time_offset(reference.view(), study.view());
    ASSERT_TRUE(found.has_value()) << found.error().text();
    EXPECT_TRUE(found->clock_rate_estimated);
    EXPECT_NEAR(found->clock_rate, rate, 10e-6);
    EXPECT_NEAR(found->offset_s, 1.25, 0.005);
  }
}

TEST(TimeOffset, ItsSdIsOfTheSizeOfItsError) {
  std::vector<double> in_sd;
  constexpr unsigned kRuns = 40;
  for (unsigned seed = 0; seed < kRuns; ++seed) {
    const test::SineSum omega = test::car_rates(60 + seed);
    const Series reference = recorded(omega, 0.0, 130.0, 100.0, 1e-5, 5, [](double t) { return t; });
    const Series study =
        recorded(omega, 1.0, 129.0, 100.0, kMtxNoise_radps, 6 + seed, [](double t) { return t - 0.1; });
    const Result<TimeOffset> found = find_time_offset(reference.view(), study.view());
    ASSERT_TRUE(found.has_value()) << found.error().text();
    in_sd.push_back(std::abs(found->offset_s - 0.1) / found->sd_s);
  }
  // With an sd from four segments or fewer the ratio follows Student's law, whose tails have no mean square:
  // its median is 0.67 for a known sd, 0.76 for four segments and 1.00 for two.
  std::nth_element(in_sd.begin(), in_sd.begin() + kRuns / 2, in_sd.end());
  EXPECT_LT(in_sd[kRuns / 2], 1.5);
  EXPECT_GT(in_sd[kRuns / 2], 0.4);
}

TEST(TimeOffset, WithoutMotionTheAnswerIsAReasonNotANumber) {
  const test::SineSum still(1, Eigen::Vector3d::Zero(), {});
  const Series a = recorded(still, 0.0, 100.0, 100.0, 1e-4, 7, [](double t) { return t; });
  const Series b = recorded(still, 0.0, 100.0, 100.0, 1e-4, 8, [](double t) { return t; });
  const Result<TimeOffset> found = find_time_offset(a.view(), b.view());
  ASSERT_FALSE(found.has_value());
  EXPECT_NE(found.error().text().find("turns"), std::string::npos);
}

TEST(TimeOffset, TwoDifferentDrivesAreNotMatched) {
  const Series a = recorded(test::car_rates(42), 0.0, 300.0, 100.0, 1e-5, 9, [](double t) { return t; });
  const Series b =
      recorded(test::car_rates(43), 0.0, 300.0, 100.0, kMtxNoise_radps, 10, [](double t) { return t; });
  const Result<TimeOffset> found = find_time_offset(a.view(), b.view());
  if (found.has_value()) {
    EXPECT_LT(found->distinctness, 1.2);
    EXPECT_LT(found->correlation, 0.7);
  }
}

TEST(TimeOffset, AHoleInTheStudyRecordingDoesNotDisturb) {
  const test::SineSum omega = test::car_rates(44);
  const Series reference = recorded(omega, 0.0, 300.0, 100.0, 1e-5, 11, [](double t) { return t; });
  Series study = recorded(omega, 10.0, 290.0, 100.0, kMtxNoise_radps, 12, [](double t) { return t - 2.0; });
  study.time_s.erase(study.time_s.begin() + 9000, study.time_s.begin() + 12000);
  study.rate.erase(study.rate.begin() + 9000, study.rate.begin() + 12000);
  const Result<TimeOffset> found = find_time_offset(reference.view(), study.view());
  ASSERT_TRUE(found.has_value()) << found.error().text();
  EXPECT_NEAR(found->offset_s + found->clock_rate * 140.0, 2.0, 0.004);
}

TEST(LiveTimeOffset, FindsAnOffsetWithinTwoSecondsFromTheLastTwenty) {
  for (const double offset : {-1.7, -0.003, 0.25, 1.9}) {
    const test::SineSum omega = test::car_rates(45);
    const auto live = std::make_unique<LiveTimeOffset>();
    std::mt19937 random(3);
    std::normal_distribution<> noise(0.0, kMtxNoise_radps);
    TimeOffset out;
    EXPECT_FALSE(live->estimate(out));
    for (int i = 0; i < 6000; ++i) {
      const double t = 0.01 * i + 3.0;
      live->add_reference(HostTime{from_seconds(t)}, omega(t).norm());
      const Eigen::Vector3d w = omega(t) + Eigen::Vector3d(noise(random), noise(random), noise(random));
      live->add_study(HostTime{from_seconds(t - offset)}, w.norm());
    }
    ASSERT_TRUE(live->estimate(out)) << offset;
    EXPECT_NEAR(out.offset_s, offset, 0.015);
    EXPECT_GT(out.correlation, 0.5);
  }
}

TEST(LiveTimeOffset, SaysNothingAtRest) {
  const auto live = std::make_unique<LiveTimeOffset>();
  std::mt19937 random(4);
  std::normal_distribution<> noise(0.0, 1e-3);
  for (int i = 0; i < 6000; ++i) {
    const HostTime t{from_seconds(0.01 * i)};
    live->add_reference(t, std::abs(noise(random)));
    live->add_study(t, std::abs(noise(random)));
  }
  TimeOffset out;
  EXPECT_FALSE(live->estimate(out));
}

}  // namespace
}  // namespace imuscope
