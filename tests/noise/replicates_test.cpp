#include "noise/replicates.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

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

TEST(Replicates, PooledEqualsOneRecordWithGaps) {
  auto x = series(3000, 1.0, 1);
  std::vector<std::uint8_t> mask(x.size(), 1);
  mask[1000] = 0;
  mask[2100] = 0;
  WvOptions options;
  options.mask = mask;
  const auto whole = haar_wavelet_variance(x, options).value();
  const std::span<const double> all(x);
  const auto pooled = pool(std::vector{haar_wavelet_variance(all.subspan(0, 1000)).value(),
                                       haar_wavelet_variance(all.subspan(1001, 1099)).value(),
                                       haar_wavelet_variance(all.subspan(2101)).value()});
  ASSERT_EQ(pooled.levels.size(), whole.levels.size());
  for (std::size_t i = 0; i < whole.levels.size(); ++i) {
    EXPECT_NEAR(pooled.levels[i].value / whole.levels[i].value, 1.0, 1e-12);
    EXPECT_EQ(pooled.levels[i].n_coefficients, whole.levels[i].n_coefficients);
  }
}

TEST(Replicates, EqualReplicatesPassAndOneWithMoreNoiseFailsTheTestOfHomogeneity) {
  const auto spec = parse_model("WN+GM").value();
  const auto same = fit_jointly(replicates({1, 1, 1, 1}, 10), spec, 100.0).value();
  ASSERT_TRUE(same.homogeneity.has_value());
  EXPECT_EQ(same.homogeneity->dof, 9);
  EXPECT_GT(same.homogeneity->p_value, 0.001);
  const auto different = fit_jointly(replicates({1, 1, 1.3, 1}, 20), spec, 100.0).value();
  EXPECT_LT(different.homogeneity->p_value, 1e-6);
  EXPECT_LT(*same.pooled.parameters[0].sd, *same.separate[0].parameters[0].sd);
}

TEST(Replicates, OneReplicateIsRefused) {
  EXPECT_FALSE(fit_jointly(replicates({1}, 1), parse_model("WN").value(), 100.0));
}

TEST(DistanceFromModel, IsChiSquareWhileNothingChangesAndLargeWhenItDoes) {
  const Model model{{{ProcessKind::kWhiteNoise, 1.0, {}},
                     {ProcessKind::kGaussMarkov, 0.09 / (1.0 - 0.95 * 0.95), {-std::log(0.95), 0.0}}}};
  int alarms = 0;
  constexpr int kWindows = 300;
  for (unsigned i = 0; i < kWindows; ++i) {
    const auto wv = haar_wavelet_variance(series(2048, 1.0, 100 + i)).value();
    alarms += distance_from_model(wv, model)->p_value < 0.05 ? 1 : 0;
  }
  // 15 expected; the chance of more than 30 is 2e-4 at the nominal level.
  EXPECT_LE(alarms, 30);
  EXPECT_GE(alarms, 3);
  const auto changed = haar_wavelet_variance(series(2048, 1.3, 999)).value();
  EXPECT_LT(distance_from_model(changed, model)->p_value, 1e-6);
}

TEST(OverBoundingModel, LiesAboveEveryUpperIntervalEnd) {
  const auto wv = haar_wavelet_variance(series(8192, 1.0, 5)).value();
  const auto result = fit(wv, parse_model("WN+GM").value(), 100.0).value();
  const Model bound = over_bounding_model(result);
  for (const auto& level : result.wv) {
    EXPECT_GE(model_wv(bound, level.observed.level), level.model_ci_high * (1.0 - 1e-12));
  }
}

}  // namespace
}  // namespace imuscope::noise
