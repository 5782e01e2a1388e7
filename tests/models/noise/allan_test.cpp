/// The Allan deviation against its definition, and against the closed form of white noise.

#include "models/noise/allan.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace imuscope::noise {
namespace {

std::vector<double> noise_with_offset(std::size_t n) {
  std::mt19937_64 random(17);
  std::normal_distribution<double> normal;
  std::vector<double> x(n);
  double walk = 0.0;
  for (double& v : x) {
    walk += 0.02 * normal(random);
    v = 1000.0 + walk + normal(random);
  }
  return x;
}

/// Mean of the valid ones of n samples from `begin` on; NaN where more than an eighth is missing.
double mean_of(const std::vector<double>& x, const std::vector<std::uint8_t>& mask, std::size_t begin,
               std::size_t n) {
  double sum = 0.0;
  std::size_t there = 0;
  for (std::size_t i = begin; i < begin + n; ++i) {
    if (mask[i] == 0) continue;
    sum += x[i] - 1000.0;
    ++there;
  }
  return there >= n - n / 8 ? sum / static_cast<double>(there) : std::nan("");
}

double variance_by_definition(const std::vector<double>& x, const std::vector<std::uint8_t>& mask,
                              std::size_t n) {
  double sum = 0.0;
  double count = 0.0;
  for (std::size_t i = 0; i + 2 * n <= x.size(); ++i) {
    const double difference = mean_of(x, mask, i + n, n) - mean_of(x, mask, i, n);
    if (std::isnan(difference)) continue;
    sum += difference * difference;
    count += 1.0;
  }
  return 0.5 * sum / count;
}

void expect_the_definition(const std::vector<double>& x, const std::vector<std::uint8_t>& mask,
                           std::uint64_t longest, double tolerance) {
  WvOptions options;
  options.mask = mask;
  const auto wv = haar_wavelet_variance(x, options).value();
  const auto points = allan_deviation(x, wv, 100.0);
  ASSERT_GT(points.size(), 20U);
  for (const AllanPoint& point : points) {
    if (point.n > longest) break;
    const double inflation = wv.levels[static_cast<std::size_t>(std::log2(point.n))].inflation;
    const double expected = variance_by_definition(x, mask, point.n) / inflation;
    EXPECT_NEAR(point.deviation * point.deviation / expected, 1.0, tolerance) << point.n;
  }
}

TEST(Allan, AWholeRecordHasWhatTheDefinitionSays) {
  // Up to here every place counts.
  expect_the_definition(noise_with_offset(5000), std::vector<std::uint8_t>(5000, 1), 63, 1e-10);
}

TEST(Allan, MissingSamplesAreBorneAsTheDefinitionSays) {
  std::vector<std::uint8_t> mask(5000, 1);
  for (const std::size_t at : {0, 700, 701, 1999, 3210, 4999}) mask[at] = 0;
  // What is taken out of the squares is read off between two levels.
  expect_the_definition(noise_with_offset(5000), mask, 63, 2e-3);
}

TEST(Allan, IsTwiceTheWaveletVarianceAtPowersOfTwo) {
  const auto x = noise_with_offset(1U << 14U);
  const auto wv = haar_wavelet_variance(x).value();
  std::size_t met = 0;
  for (const AllanPoint& point : allan_deviation(x, wv, 100.0)) {
    for (const WvLevel& level : wv.levels) {
      if (2.0 * static_cast<double>(point.n) != level.tau_samples) continue;
      EXPECT_NEAR(point.deviation * point.deviation / (2.0 * level.value), 1.0, 1e-12);
      ++met;
    }
  }
  EXPECT_GT(met, 10U);
}

}  // namespace
}  // namespace imuscope::noise
