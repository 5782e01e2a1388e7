#include "models/noise/dependence.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace imuscope::noise {
namespace {

constexpr double kRate_hz = 100.0;
constexpr std::size_t kWindow = 2000;

/// Windows of white noise whose variance is exp(slope x), x from 0 to 2.
std::vector<std::vector<double>> white_windows(std::size_t n, double slope, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::vector<std::vector<double>> windows;
  for (std::size_t w = 0; w < n; ++w) {
    const double x = 2.0 * static_cast<double>(w) / static_cast<double>(n - 1);
    std::vector<double> values(kWindow);
    for (double& value : values) value = std::exp(0.5 * slope * x) * normal(random);
    windows.push_back(std::move(values));
  }
  return windows;
}

struct Example {
  std::vector<DrivenWindow> windows;
  FitResult start;
};

Example example_of(const std::vector<std::vector<double>>& signals, const char* model) {
  Example out;
  std::vector<double> all;
  for (std::size_t w = 0; w < signals.size(); ++w) {
    all.insert(all.end(), signals[w].begin(), signals[w].end());
    out.windows.push_back({haar_wavelet_variance(signals[w]).value(),
                           {2.0 * static_cast<double>(w) / static_cast<double>(signals.size() - 1)}});
  }
  out.start = fit(haar_wavelet_variance(all).value(), parse_model(model).value(), kRate_hz).value();
  return out;
}

TEST(Dependence, OfWhiteNoiseHasTheSlopeAndTheSdOfItsRegression) {
  const auto example = example_of(white_windows(60, 0.5, 1), "WN");
  const auto found = fit_dependence(example.windows, example.start);
  ASSERT_TRUE(found) << found.error().text();
  ASSERT_EQ(found->slopes.size(), 1u);
  const auto& slope = found->slopes[0];
  EXPECT_EQ(slope.process, "WN");
  EXPECT_EQ(slope.name, "sigma2");
  EXPECT_LT(slope.p_value, 1e-6);
  EXPECT_NEAR(slope.slope, 0.5, 3.5 * slope.sd);
  // log of a sample variance of n values has sd sqrt(2/n); x is uniform on [0, 2].
  double squares = 0.0;
  for (const auto& w : example.windows) squares += (w.drivers[0] - 1.0) * (w.drivers[0] - 1.0);
  const double expected_sd = std::sqrt(2.0 / static_cast<double>(kWindow) / squares);
  EXPECT_NEAR(slope.sd, expected_sd, 0.35 * expected_sd);
  EXPECT_NEAR(slope.at_mean_driver, std::exp(0.5), 0.02);
}

TEST(Dependence, WhatWindowsDoNotDetermineIsSaid) {
  // A process slower than the windows by far: its level shows in none of them.
  auto signals = white_windows(40, 0.0, 2);
  std::mt19937 random(9);
  std::normal_distribution<double> normal;
  double slow = 0.0;
  for (auto& window : signals) {
    for (double& value : window)
      value += slow = 0.99999 * slow + std::sqrt(1.0 - 0.99998) * 0.2 * normal(random);
  }
  const auto example = example_of(signals, "WN+GM");
  const auto found = fit_dependence(example.windows, example.start);
  ASSERT_TRUE(found) << found.error().text();
  EXPECT_FALSE(found->undetermined.empty());
  for (const auto& slope : found->slopes) EXPECT_EQ(slope.process, "WN");
}

TEST(Dependence, WindowsThatDoNotVaryAndTooFewOfThemAreRefused) {
  auto example = example_of(white_windows(20, 0.0, 3), "WN");
  const std::span<const DrivenWindow> few(example.windows.data(), 5);
  const auto refused = fit_dependence(few, example.start);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text(), ::testing::HasSubstr("there are 5 windows and 12 are needed"));
  for (auto& window : example.windows) window.drivers[0] = 4.0;
  const auto constant = fit_dependence(example.windows, example.start);
  ASSERT_FALSE(constant);
  EXPECT_THAT(constant.error().text(), ::testing::HasSubstr("does not vary"));
  // What rounding makes of a large constant is no variation, either.
  for (std::size_t i = 0; i < example.windows.size(); ++i)
    example.windows[i].drivers[0] = 1e6 + (i % 2 == 0 ? 1e-4 : 0.0);
  EXPECT_FALSE(fit_dependence(example.windows, example.start));
  for (std::size_t i = 0; i < example.windows.size(); ++i)
    example.windows[i].drivers[0] = 1e6 + (i % 2 == 0 ? 1e-2 : 0.0);
  EXPECT_TRUE(fit_dependence(example.windows, example.start));
}

TEST(Dependence, WindowsTooShortForAnyLevelAreRefused) {
  auto example = example_of(white_windows(20, 0.0, 4), "WN");
  for (auto& window : example.windows)
    window.wv = haar_wavelet_variance(std::vector<double>{0.1, -0.2, 0.3}).value();
  const auto refused = fit_dependence(example.windows, example.start);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text(), ::testing::HasSubstr("windows are too short"));
  EXPECT_FALSE(refused.error().remedy.empty());
}

TEST(Dependence, ADriverThatIsNoNumberSomewhereIsRefused) {
  auto example = example_of(white_windows(20, 0.0, 5), "WN");
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    auto windows = example.windows;
    windows[7].drivers = {bad};
    const auto refused = fit_dependence(windows, example.start);
    ASSERT_FALSE(refused) << bad;
    EXPECT_THAT(refused.error().text(), ::testing::HasSubstr("driver of window 8 is no number"));
  }
}

TEST(Dependence, OneWindowFarFromTheOthersMakesNoneAndIsCounted) {
  const auto clean = example_of(white_windows(20, 0.0, 6), "WN");
  const auto without = fit_dependence(clean.windows, clean.start);
  ASSERT_TRUE(without);
  EXPECT_EQ(without->n_far, 0u);
  for (const double factor : {1e2, 1e8, 1e100, 1e300, std::numeric_limits<double>::infinity()}) {
    for (const std::size_t far : {0u, 7u, 19u}) {
      auto windows = clean.windows;
      for (auto& level : windows[far].wv.levels) level.value *= factor;
      const auto found = fit_dependence(windows, clean.start);
      ASSERT_TRUE(found) << found.error().text();
      EXPECT_EQ(found->n_far, 1u) << factor << " window " << far;
      ASSERT_EQ(found->slopes.size(), 1u);
      EXPECT_GT(found->slopes[0].p_value, 0.05) << factor << " window " << far;
      EXPECT_LT(std::abs(found->slopes[0].slope), 0.5) << factor << " window " << far;
    }
  }
}

TEST(Dependence, OfAPlantedSlopeIsFoundBesideAFarWindow) {
  auto example = example_of(white_windows(60, 0.5, 7), "WN");
  for (auto& level : example.windows[3].wv.levels) level.value *= 1e4;
  const auto found = fit_dependence(example.windows, example.start);
  ASSERT_TRUE(found) << found.error().text();
  EXPECT_EQ(found->n_far, 1u);
  EXPECT_LT(found->slopes.at(0).p_value, 1e-6);
  EXPECT_NEAR(found->slopes.at(0).slope, 0.5, 3.5 * found->slopes.at(0).sd);
}

TEST(Dependence, WhereMostWindowsAreNoNumbersIsRefused) {
  auto example = example_of(white_windows(20, 0.0, 8), "WN");
  for (std::size_t w = 0; w < 11; ++w)
    example.windows[w].wv.levels.front().value = std::numeric_limits<double>::infinity();
  const auto refused = fit_dependence(example.windows, example.start);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text(), ::testing::HasSubstr("does not settle"));
}

TEST(WhiteNoiseOfAWindow, IsThatOfTheWindowWithAnIntervalThatHoldsItAsOftenAsItSays) {
  // A Gauss-Markov process beside white noise of another variance than the model's.
  const Model model{{{ProcessKind::kWhiteNoise, 1.0, {}}, {ProcessKind::kGaussMarkov, 0.3, {0.02, 0.0}}}};
  constexpr double kVariance = 1.2;
  constexpr int kWindows = 300;
  std::mt19937 random(21);
  std::normal_distribution<double> normal;
  const double phi = std::exp(-0.02);
  double sum = 0.0;
  int held = 0;
  for (int w = 0; w < kWindows; ++w) {
    std::vector<double> x(kWindow);
    double state = std::sqrt(0.3) * normal(random);
    for (double& value : x) {
      state = phi * state + std::sqrt(0.3 * (1.0 - phi * phi)) * normal(random);
      value = state + std::sqrt(kVariance) * normal(random);
    }
    const auto found = white_noise_of(haar_wavelet_variance(x).value(), model, 0.9);
    ASSERT_TRUE(found);
    EXPECT_LT(found->ci_low, found->value);
    EXPECT_GT(found->ci_high, found->value);
    sum += found->value;
    held += found->ci_low <= kVariance && kVariance <= found->ci_high ? 1 : 0;
  }
  // The variance of 2000 values of white noise by their differences is known to 4 %.
  EXPECT_NEAR(sum / kWindows, kVariance, 4.0 * 0.04 * kVariance / std::sqrt(kWindows));
  // 270 of 300, sd 5.2.
  EXPECT_NEAR(held, 270, 21);
}

TEST(WhiteNoiseOfAWindow, IsAbsentWhereNothingSaysWhatItIs) {
  const Model white{{{ProcessKind::kWhiteNoise, 1.0, {}}}};
  const Model loud{{{ProcessKind::kWhiteNoise, 1.0, {}}, {ProcessKind::kGaussMarkov, 100.0, {1.0, 0.0}}}};
  const Model none{{{ProcessKind::kGaussMarkov, 1.0, {0.02, 0.0}}}};
  const auto window = haar_wavelet_variance(white_windows(2, 0.0, 6).front()).value();
  EXPECT_TRUE(white_noise_of(window, white, 0.95));
  EXPECT_FALSE(white_noise_of(WaveletVariance{}, white, 0.95)) << "a window without a level";
  EXPECT_FALSE(white_noise_of(window, none, 0.95)) << "a model without white noise";
  EXPECT_FALSE(white_noise_of(window, loud, 0.95)) << "a model that explains more than is there";
}

/// Two drivers that go together, as speed and vibration do; the noise follows the second alone.
struct Correlated {
  std::vector<DrivenWindow> windows;
  FitResult start;
};

Correlated correlated(std::size_t n, double slope, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Correlated out;
  std::vector<double> all;
  for (std::size_t w = 0; w < n; ++w) {
    const double common = normal(random);
    const std::vector<double> drivers{10.0 + 3.0 * (common + 0.5 * normal(random)),
                                      common + 0.5 * normal(random)};
    std::vector<double> values(kWindow);
    for (double& value : values) value = std::exp(0.5 * slope * drivers[1]) * normal(random);
    all.insert(all.end(), values.begin(), values.end());
    out.windows.push_back({haar_wavelet_variance(values).value(), drivers});
  }
  out.start = fit(haar_wavelet_variance(all).value(), parse_model("WN").value(), kRate_hz).value();
  return out;
}

TEST(Dependence, OnSeveralDriversIsGivenToTheOneThatItIsOn) {
  const auto example = correlated(60, 0.3, 3);
  std::vector<DrivenWindow> first_alone = example.windows;
  for (auto& window : first_alone) window.drivers.resize(1);
  const auto alone = fit_dependence(first_alone, example.start);
  ASSERT_TRUE(alone) << alone.error().text();
  EXPECT_LT(alone->slopes[0].p_value, 1e-6) << "by itself it seems to be on the first";
  const auto both = fit_dependence(example.windows, example.start);
  ASSERT_TRUE(both) << both.error().text();
  ASSERT_EQ(both->slopes.size(), 2U);
  EXPECT_EQ(both->slopes[0].driver, 0U);
  EXPECT_EQ(both->slopes[1].driver, 1U);
  EXPECT_NEAR(both->slopes[1].slope, 0.3, 3.5 * both->slopes[1].sd);
  EXPECT_LT(both->slopes[1].p_value, 1e-6);
  EXPECT_NEAR(both->slopes[0].slope, 0.0, 3.5 * both->slopes[0].sd);
  ASSERT_EQ(both->mean_drivers.size(), 2U);
  EXPECT_NEAR(both->mean_drivers[0], 10.0, 1.5);
}

// Of no dependence on the first driver, beside a strong one on the second.
TEST(Dependence, OnSeveralDriversRejectsAsRarelyAsItSays) {
  int rejected = 0;
  int held = 0;
  constexpr int kSeries = 200;
  for (unsigned seed = 1; seed <= kSeries; ++seed) {
    const auto example = correlated(40, 0.3, 100 + seed);
    const auto found = fit_dependence(example.windows, example.start);
    ASSERT_TRUE(found) << found.error().text();
    ASSERT_EQ(found->slopes.size(), 2U);
    rejected += found->slopes[0].p_value < 0.05 ? 1 : 0;
    held += found->slopes[1].ci_low <= 0.3 && 0.3 <= found->slopes[1].ci_high ? 1 : 0;
  }
  // 10 and 190 expected; each limit has a chance of 2e-4.
  EXPECT_LE(rejected, 22);
  EXPECT_GE(held, 178);
}

TEST(Dependence, OnTwoDriversThatAreOneTellsOfNeither) {
  auto example = correlated(40, 0.3, 5);
  for (auto& window : example.windows) window.drivers[0] = 2.0 * window.drivers[1] + 1.0;
  const auto found = fit_dependence(example.windows, example.start);
  ASSERT_TRUE(found) << found.error().text();
  EXPECT_LE(found->slopes.size(), 1U);
  EXPECT_GE(found->undetermined.size(), 1U);
}

}  // namespace
}  // namespace imuscope::noise
