/// A PC whose clock NTP steers, as it is read fifty times a second, and what is told of it.

#include "drivers/transport/steering_watch.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include "tests/support/answer.h"
#include "tests/support/recorded_answer.h"

namespace imuscope {
namespace {

using test::Answer;
using test::expect_recorded;

constexpr double kPeriod_s = 0.02;

struct Outcome {
  std::vector<double> errors_s;  ///< of the quartz by what was told, just before the next reading, sorted
  int told = 0;
  [[nodiscard]] double quantile(double share) const {
    return errors_s[static_cast<std::size_t>(share * static_cast<double>(errors_s.size() - 1))];
  }
};

/// @param gained_s  by the host's clock over its quartz at a true second
Outcome watch(double length_s, const std::function<double(double)>& gained_s) {
  std::mt19937_64 random(11);
  std::normal_distribution<double> noise(0.0, 0.1e-6);
  const HostTime begin = host_time_from_ns(1'000'000'000'000);
  const HostTime quartz_begin = host_time_from_ns(77'000'000'000'000);
  SteeringWatch watch;
  std::optional<ClockSteering> told;
  Outcome outcome;
  const auto n = static_cast<int>(length_s / kPeriod_s);
  for (int k = 0; k < n; ++k) {
    const double t_s = k * kPeriod_s;
    const HostTime host = begin + from_seconds(t_s + gained_s(t_s));
    if (told && k > 50) {
      const Duration since = host - told->time;
      const HostTime by_told = told->unsteered + since + from_seconds(told->rate * to_seconds(since));
      outcome.errors_s.push_back(std::abs(to_seconds(by_told - quartz_begin) - t_s));
    }
    const ClockSteering reading{host, quartz_begin + from_seconds(t_s + noise(random)), 0.0, Duration{100}};
    if (const auto news = watch.look(reading)) {
      told = news;
      ++outcome.told;
    }
  }
  std::sort(outcome.errors_s.begin(), outcome.errors_s.end());
  return outcome;
}

TEST(SteeringWatch, SaysLittleOfAClockThatIsSteeredEvenly) {
  for (const double ppm : {0.0, -23.4, 80.0}) {
    const Outcome outcome = watch(600.0, [ppm](double t_s) { return ppm * 1e-6 * t_s; });
    EXPECT_LT(outcome.quantile(1.0), 1e-6) << ppm;
    EXPECT_LT(outcome.told, 30) << ppm;
  }
}

TEST(SteeringWatch, TellsASlewWithinTheReadingAfterIt) {
  for (const double ppm : {-500.0, 100.0, 20.0, 500.0}) {
    const Outcome outcome = watch(120.0, [ppm](double t_s) {
      return -12e-6 * t_s + ppm * 1e-6 * (std::clamp(t_s, 60.007, 70.013) - 60.007);
    });
    EXPECT_LT(outcome.quantile(0.99), 1.2e-6) << ppm;
    EXPECT_LT(outcome.quantile(1.0), 1e-6 + std::abs(ppm) * 1e-6 * kPeriod_s * 1.5) << ppm;
    EXPECT_LT(outcome.told, 120) << ppm;
  }
}

TEST(SteeringWatch, SmallCorrectionsFillNoCapture) {
  // As chrony makes them: a few hundredths of a ppm every sixteen seconds.
  const Outcome outcome = watch(1200.0, [](double t_s) {
    double gained_s = 0.0;
    for (double from_s = 0.0; from_s < t_s; from_s += 16.0)
      gained_s += 0.05e-6 * std::sin(from_s) * std::min(16.0, t_s - from_s);
    return gained_s;
  });
  EXPECT_LT(outcome.quantile(1.0), 1.2e-6);
  EXPECT_LT(outcome.told, 1200);
}

// A slow clock that is slewed, stepped by little, swings, and now and then is read badly.
TEST(SteeringWatch, WhatItTellsOfOneClock) {
  constexpr int kReadings = 4000;
  const HostTime begin = host_time_from_ns(1'000'000'000'000);
  const HostTime quartz_begin = host_time_from_ns(77'000'000'000'000);
  SteeringWatch watch;
  Answer answer;
  double gained_s = 0.0;
  for (int k = 0; k < kReadings; ++k) {
    const double t_s = k * kPeriod_s;
    const double ppm = k < 700    ? -20.0
                       : k < 720  ? 480.0
                       : k < 1500 ? 3.0
                       : k < 2600 ? 12.0 * std::sin(0.01 * k)
                                  : 1.0;
    gained_s += ppm * 1e-6 * kPeriod_s + (k % 311 == 310 ? 1.7e-6 : 0.0);
    const double noise_s = 0.15e-6 * std::sin(12.9898 * k) + (k % 97 == 96 ? 3e-6 : 0.0);
    const Duration apart{100 + 37 * (k % 29)};
    const HostTime host = begin + from_seconds(t_s + gained_s);
    const HostTime quartz = quartz_begin + from_seconds(t_s + noise_s);
    if (const auto news = watch.look({host, quartz, 0.0, apart}))
      answer.line(k, (news->time - begin).count(), (news->unsteered - quartz_begin).count(),
                  1e6 * news->rate);
  }
  expect_recorded("drivers/transport/steering_of_a_clock.txt", answer.text());
}

TEST(SteeringWatch, AReadingWhoseClocksLieApartIsNone) {
  SteeringWatch watch;
  const HostTime begin = host_time_from_ns(1'000'000'000'000);
  for (int k = 0; k < 10; ++k) {
    const HostTime host = begin + from_seconds(k * kPeriod_s);
    EXPECT_FALSE(watch.look({host, host + std::chrono::milliseconds(k), 0.0, std::chrono::microseconds(50)}));
  }
}

}  // namespace
}  // namespace imuscope
