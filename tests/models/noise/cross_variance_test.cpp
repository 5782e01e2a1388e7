#include "models/noise/cross_variance.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "models/noise/model.h"
#include "models/noise/quantities.h"
#include "models/noise/simulated_noise.h"

namespace imuscope::noise {
namespace {

constexpr double kCrossRate_hz = 100.0;

std::vector<double> white(std::size_t n, double sd, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal(0.0, sd);
  std::vector<double> x(n);
  for (double& v : x) v = normal(random);
  return x;
}

FitResult fit_of(std::span<const double> x, const char* model = "WN") {
  const auto wv = haar_wavelet_variance(x);
  const auto result = fit(*wv, *parse_model(model), kCrossRate_hz);
  return *result;
}

/// W_{j,t} at every t where both halves are whole and valid, by its definition.
std::vector<double> coefficients(std::span<const double> x, std::span<const std::uint8_t> mask, int level) {
  const auto n = std::size_t{1} << (level - 1);
  std::vector<double> out;
  for (std::size_t t = 2 * n; t <= x.size(); ++t) {
    double newer = 0.0;
    double older = 0.0;
    bool whole = true;
    for (std::size_t i = 0; i < n; ++i) {
      newer += x[t - 1 - i];
      older += x[t - 1 - n - i];
      whole = whole && mask[t - 1 - i] != 0 && mask[t - 1 - n - i] != 0;
    }
    if (whole) out.push_back((newer - older) / (2.0 * static_cast<double>(n)));
  }
  return out;
}

TEST(CrossVariance, IsTheMeanProductOfTheCoefficients) {
  const auto common = white(3000, 2e-3, 1);
  auto x = white(3000, 1e-3, 2);
  auto y = white(3000, 5.0, 3);  // in another unit
  for (std::size_t i = 0; i < x.size(); ++i) {
    x[i] += common[i];
    y[i] += 1e4 * common[i];
  }
  std::vector<std::uint8_t> mask(x.size(), 1);
  for (std::size_t i = 1000; i < 1400; ++i) mask[i] = 0;
  x[1100] = std::nan("");  // in the gap
  const std::vector<std::span<const double>> signals{x, y};
  const auto levels = cross_variance(signals, mask, std::vector{fit_of(common), fit_of(common)});
  ASSERT_TRUE(levels);
  x[1100] = 0.0;
  // From level 4 on a half bears a missing sample.
  for (int level = 1; level <= 3; ++level) {
    const auto wx = coefficients(x, mask, level);
    const auto wy = coefficients(y, mask, level);
    double mean = 0.0;
    for (std::size_t t = 0; t < wx.size(); ++t) mean += wx[t] * wy[t] / static_cast<double>(wx.size());
    EXPECT_NEAR((*levels)[static_cast<std::size_t>(level - 1)].covariance(0, 1), mean, 1e-9 * std::abs(mean))
        << level;
  }
}

TEST(CrossVariance, ASampleThatOneSignalLacksIsOneThatAllLack) {
  auto x = white(1000, 1.0, 1);
  const auto y = white(1000, 1.0, 2);
  const std::vector<std::span<const double>> signals{x, y};
  const std::vector fits{fit_of(x), fit_of(y)};
  x[500] = std::nan("");
  const auto lacking = cross_variance(signals, {}, fits);
  x[500] = 7e9;
  std::vector<std::uint8_t> mask(x.size(), 1);
  mask[500] = 0;
  const auto masked = cross_variance(signals, mask, fits);
  ASSERT_TRUE(lacking && masked);
  EXPECT_EQ(lacking->front().covariance, masked->front().covariance);
  EXPECT_LT(lacking->front().covariance(0, 0), 2.0);
}

TEST(CrossVariance, WhiteNoiseHasTheKnownDegreesOfFreedom) {
  // Level 1: W = (x_t - x_{t-1}) / 2, correlation -1/2 at lag 1: M / (1 + 2/4).
  const auto x = white(20'001, 1.0, 1);
  const auto y = white(20'001, 1.0, 2);
  const std::vector<std::span<const double>> signals{x, y};
  const auto levels = cross_variance(signals, {}, std::vector{fit_of(x), fit_of(y)});
  ASSERT_TRUE(levels);
  EXPECT_NEAR(levels->front().dof, 20'000.0 / 1.5, 0.002 * 20'000.0);
}

TEST(CrossVariance, PartsOfThreeSensorsAddUp) {
  CrossLevel level;
  level.dof = 1e9;
  level.covariance.resize(3, 3);
  level.covariance << 5.0, 2.0, 2.0, 2.0, 4.0, 2.0, 2.0, 2.0, 3.0;
  EXPECT_NEAR(common_of(level, 0.95).value, 2.0, 1e-12);
  EXPECT_NEAR(own_of(level, 0, 0.95).value, 3.0, 1e-12);
  EXPECT_NEAR(own_of(level, 2, 0.95).value, 1.0, 1e-12);
  EXPECT_NEAR(cross_covariance_of(level, 0, 2, 0.95).value, 2.0, 1e-12);
  EXPECT_NEAR(common_of(level, 0.95).ci_high, 2.0, 1e-3) << "so many squares leave no doubt";
}

TEST(CrossVariance, TheIntervalOfAVarianceIsThatOfChiSquared) {
  CrossLevel level;
  level.dof = 8.0;
  level.covariance = 3.0 * Eigen::MatrixXd::Identity(2, 2);
  Eigen::MatrixXd first = Eigen::MatrixXd::Zero(2, 2);
  first(0, 0) = 1.0;
  const Estimate interval = estimate_of(level, first, 0.95);
  // chi2 of 8: 2.1797, 17.5345 (tables).
  EXPECT_NEAR(interval.ci_low, 3.0 * 8.0 / 17.5345, 1e-3);
  EXPECT_NEAR(interval.ci_high, 3.0 * 8.0 / 2.1797, 1e-3);
}

TEST(CrossVariance, WeightsAreTheInverseVariancesWhereNothingIsInCommonAndBeatEveryNeighbour) {
  CrossLevel level;
  level.covariance = Eigen::Vector3d(1.0, 2.0, 4.0).asDiagonal();
  const Eigen::VectorXd weights = quietest_weights(std::span(&level, 1));
  EXPECT_NEAR(weights[0], 4.0 / 7.0, 1e-12);
  EXPECT_NEAR(weights[2], 1.0 / 7.0, 1e-12);
  level.covariance << 5.0, 2.0, 1.0, 2.0, 4.0, 2.5, 1.0, 2.5, 3.0;
  const Eigen::VectorXd best = quietest_weights(std::span(&level, 1));
  EXPECT_NEAR(best.sum(), 1.0, 1e-12);
  for (const Eigen::Vector3d& step :
       {Eigen::Vector3d(1, -1, 0), Eigen::Vector3d(0, 1, -1), Eigen::Vector3d(1, 0, -1)}) {
    for (const double size : {-0.01, 0.01})
      EXPECT_GT(weighted_variance(level, best + size * step), weighted_variance(level, best));
  }
  level.covariance = Eigen::MatrixXd::Ones(3, 3);  // three copies
  EXPECT_NEAR(quietest_weights(std::span(&level, 1))[1], 1.0 / 3.0, 1e-12);
}

TEST(CrossVariance, CoherenceOfWhatIsUnrelatedIsSeldomSignificant) {
  int significant = 0;
  constexpr int kPairs = 200;
  int tests = 0;
  for (int i = 0; i < kPairs; ++i) {
    const auto x = white(2048, 1.0, 1000U + 2U * static_cast<unsigned>(i));
    const auto y = white(2048, 1.0, 1001U + 2U * static_cast<unsigned>(i));
    const std::vector<std::span<const double>> signals{x, y};
    const auto levels = cross_variance(signals, {}, std::vector{fit_of(x), fit_of(y)});
    ASSERT_TRUE(levels);
    for (std::size_t j = 0; j < 8; ++j) {
      significant += coherence_of((*levels)[j], 0, 1, 0.95).p_value < 0.05 ? 1 : 0;
      ++tests;
    }
  }
  // 5 %, sd 0.54 % of 1,600 (levels are almost independent).
  EXPECT_NEAR(static_cast<double>(significant) / tests, 0.05, 3.3 * 0.0055);
}

TEST(CrossVariance, SignalsOfDifferentLengthsAreRefused) {
  const auto x = white(100, 1.0, 1);
  const auto y = white(99, 1.0, 2);
  const std::vector<std::span<const double>> signals{x, y};
  const std::vector fits{fit_of(x), fit_of(y)};
  EXPECT_FALSE(cross_variance(signals, {}, fits));
}

}  // namespace
}  // namespace imuscope::noise
