#include "models/noise/replicates.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "models/noise/compare.h"
#include "models/noise/conservative.h"
#include "models/noise/felt_noise.h"

namespace imuscope::noise {
namespace {

std::vector<double> series(std::size_t n, double sd, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<double> x(n);
  double state = 0.0;
  for (double& v : x) {
    state = 0.95 * state + 0.3 * normal(random);
    v = sd * normal(random) + state;
  }
  return x;
}

std::vector<WaveletVariance> replicates(const std::vector<double>& sds, unsigned seed) {
  std::vector<WaveletVariance> out;
  for (const double sd : sds) out.push_back(haar_wavelet_variance(series(8192, sd, seed++)).value());
  return out;
}

TEST(Replicates, PooledIsTheMeanOverTheCoefficientsOfAll) {
  auto x = series(3000, 1.0, 1);
  const std::span<const double> all(x);
  const std::vector parts{haar_wavelet_variance(all.subspan(0, 1000)).value(),
                          haar_wavelet_variance(all.subspan(1001, 1099)).value(),
                          haar_wavelet_variance(all.subspan(2101)).value()};
  const auto pooled = pool(parts);
  ASSERT_EQ(pooled.levels.size(), parts[1].levels.size());
  for (std::size_t i = 0; i < pooled.levels.size(); ++i) {
    double sum = 0.0;
    std::uint64_t count = 0;
    for (const auto& part : parts) {
      if (i >= part.levels.size()) continue;
      count += part.levels[i].n_coefficients;
      sum += part.levels[i].value * static_cast<double>(part.levels[i].n_coefficients);
    }
    EXPECT_EQ(pooled.levels[i].n_coefficients, count);
    EXPECT_NEAR(pooled.levels[i].value / (sum / static_cast<double>(count)), 1.0, 1e-12);
    EXPECT_NEAR(pooled.levels[i].inflation, 1.0, 1e-12);
  }
  // Nothing spans the joins: three runs stay three in the covariance as well.
  EXPECT_EQ(pooled.levels[8].places.size(), 3u);
  EXPECT_EQ(pooled.levels[9].places.size(), 1u) << "only the second lasts 1024 samples";
  ASSERT_EQ(pooled.segments.size(), 3u);
  for (std::size_t k = 1; k < 3; ++k)
    EXPECT_GT(pooled.segments[k].begin - pooled.segments[k - 1].end, 1024u / 8u);
}

TEST(Replicates, EqualReplicatesPassAndOneWithMoreNoiseFailsTheTestOfHomogeneity) {
  const auto spec = parse_model("WN+GM").value();
  const auto same = fit_jointly(replicates({1, 1, 1, 1}, 10), spec, 100.0).value();
  ASSERT_TRUE(same.spread.homogeneity.has_value());
  EXPECT_EQ(same.spread.homogeneity->dof, 9);
  EXPECT_GT(same.spread.homogeneity->p_value, 0.001);
  const auto different = fit_jointly(replicates({1, 1, 1.3, 1}, 20), spec, 100.0).value();
  EXPECT_LT(different.spread.homogeneity->p_value, 1e-6);
  EXPECT_LT(*same.pooled.parameters[0].sd, *same.separate[0].parameters[0].sd);
}

TEST(Replicates, OneTruthIsCalledManyAsRarelyAsTheTestPromises) {
  const auto spec = parse_model("WN+GM").value();
  int differ = 0;
  constexpr unsigned kRuns = 60;
  for (unsigned i = 0; i < kRuns; ++i) {
    std::vector<WaveletVariance> records;
    for (unsigned k = 0; k < 4; ++k)
      records.push_back(haar_wavelet_variance(series(2048, 1.0, 7000 + 4 * i + k)).value());
    differ += fit_jointly(records, spec, 100.0)->spread.homogeneity->p_value < 0.05 ? 1 : 0;
  }
  EXPECT_LE(differ, 9) << "3 expected; more than 9 has a chance of 1e-3";
}

TEST(Replicates, PooledIntervalsContainWhatReplicatesDifferBy) {
  const auto spec = parse_model("WN+GM").value();
  const auto same = fit_jointly(replicates({1, 1, 1, 1}, 10), spec, 100.0).value();
  const auto different = fit_jointly(replicates({0.8, 1, 1.2, 1}, 10), spec, 100.0).value();
  ASSERT_TRUE(different.spread.of_parameters[0] && same.spread.of_parameters[0]);
  // Sd of log sigma2 about 0.33: squares of 0.8 to 1.2.
  EXPECT_NEAR(different.spread.of_parameters[0]->spread, 0.33, 0.05);
  EXPECT_LT(same.spread.of_parameters[0]->spread, 0.05);
  EXPECT_LE(same.spread.of_parameters[0]->spread_low, same.spread.of_parameters[0]->spread);
  EXPECT_LT(std::exp(2.0 * std::log(0.8)), *different.pooled.parameters[0].ci_high);
  EXPECT_GT(*different.pooled.parameters[0].ci_high / *different.pooled.parameters[0].ci_low, 2.0);
}

/// Eight replicates whose white noise differs by 20 % (sd of the logarithm) about 1, together.
FitResult fit_of_spread_replicates(unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<WaveletVariance> records;
  for (int k = 0; k < 8; ++k) {
    const double sd = std::exp(0.1 * normal(random));
    std::vector<double> x(2048);
    for (double& v : x) v = sd * normal(random);
    records.push_back(haar_wavelet_variance(x).value());
  }
  return fit_jointly(records, parse_model("WN").value(), 100.0)->pooled;
}

TEST(Replicates, WhatTheyDifferByIsInComparisonsAndInExports) {
  int differ = 0;
  int held = 0;
  constexpr int kPairs = 100;
  for (unsigned i = 0; i < kPairs; ++i) {
    const auto first = fit_of_spread_replicates(2 * i);
    const auto compared = compare(first, fit_of_spread_replicates(2 * i + 1));
    differ += *compared.parameters.front().p_value < 0.05 ? 1 : 0;
    const Felt white = felt_white_density(first, {});
    held += white.lower <= 0.01 && 0.01 <= white.upper ? 1 : 0;
  }
  // Student's t with 14 and 7 degrees of freedom taken for a Gaussian: 7 and 91 expected. Each limit has a
  // chance of 2e-3; without the spread 60 differ and 40 hold.
  EXPECT_LE(differ, 15);
  EXPECT_GE(held, 81);
}

TEST(RandomEffects, OfEqualErrorsIsStudentsIntervalAndTheSampleVariance) {
  const std::vector<double> values{1.0, 2.0, 4.0, 5.0};
  const std::vector<double> variances(4, 0.5);
  const auto effects = random_effects(values, variances, 0.95).value();
  const double s2 = 10.0 / 3.0;
  EXPECT_NEAR(effects.mean, 3.0, 1e-9);
  EXPECT_NEAR(effects.spread * effects.spread, s2 - 0.5, 1e-9);
  constexpr double kStudent3 = 3.182446;  // 97.5 % with three degrees of freedom
  EXPECT_NEAR(effects.ci_high, 3.0 + kStudent3 * std::sqrt(s2 / 4.0), 1e-5);
  EXPECT_LT(effects.spread_low, effects.spread);
  EXPECT_GT(effects.spread_high, effects.spread);
  EXPECT_FALSE(random_effects(std::vector{1.0}, std::vector{1.0}, 0.95));
}

TEST(Replicates, OneReplicateIsRefused) {
  EXPECT_FALSE(fit_jointly(replicates({1}, 1), parse_model("WN").value(), 100.0));
}

TEST(DistanceFromModel, IsChiSquareWhileNothingChangesAndLargeWhenItDoes) {
  const auto spec = parse_model("WN+GM").value();
  int alarms = 0;
  constexpr int kWindows = 300;
  for (unsigned i = 0; i < kWindows; ++i) {
    // The reference is no longer than a window: its own uncertainty matters as much as the window's.
    const auto reference =
        fit(haar_wavelet_variance(series(4096, 1.0, 5000 + i)).value(), spec, 100.0).value();
    const auto wv = haar_wavelet_variance(series(4096, 1.0, 100 + i)).value();
    alarms += distance_from_model(wv, reference)->p_value < 0.05 ? 1 : 0;
  }
  // 15 expected; the chance of more than 30 is 2e-4 at the nominal level.
  EXPECT_LE(alarms, 30);
  EXPECT_GE(alarms, 3);
  const auto reference = fit(haar_wavelet_variance(series(8192, 1.0, 1)).value(), spec, 100.0).value();
  const auto changed = haar_wavelet_variance(series(2048, 1.3, 999)).value();
  EXPECT_LT(distance_from_model(changed, reference)->p_value, 1e-6);
}

TEST(OverBounding, ReachesEveryUpperIntervalEndThatHasEnoughCoefficientsAndIsNotWasteful) {
  const auto wv = haar_wavelet_variance(series(8192, 1.0, 5)).value();
  const auto result = fit(wv, parse_model("WN+GM").value(), 100.0).value();
  const FitResult bound = over_bounding(result);
  double closest = 1e9;
  for (const auto& level : result.wv) {
    if (!has_enough_coefficients(level.observed, result.efficiency)) continue;
    const double ratio = model_wv(bound.model, level.observed.level) / level.model_ci_high;
    EXPECT_GE(ratio, 1.0 - 1e-9);
    closest = std::min(closest, ratio);
  }
  // It touches where it is held up, and no common factor below the largest one is enough.
  EXPECT_NEAR(closest, 1.0, 1e-6);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_GE(bound.model.components[i].amplitude, result.model.components[i].amplitude);
  }
  EXPECT_EQ(bound.parameters[1].value, result.parameters[1].value) << "rates stay";
  EXPECT_NEAR(bound.parameters[0].value, bound.model.components[0].amplitude, 1e-12);
  EXPECT_FALSE(bound.parameters[0].ci_low.has_value());
}

}  // namespace
}  // namespace imuscope::noise
