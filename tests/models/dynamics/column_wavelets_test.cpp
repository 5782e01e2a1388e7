#include "models/dynamics/column_wavelets.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "models/noise/wavelet_variance.h"

namespace imuscope {
namespace {

/// A random walk and its own past: slow, and correlated with one another.
std::vector<std::array<double, 2>> two_columns(std::size_t n) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  std::vector<std::array<double, 2>> rows(n);
  double x = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    x = 0.999 * x + normal(random);
    rows[i] = {x, 0.5 * x + normal(random)};
  }
  return rows;
}

// The wavelet variance of a sum is the quadratic form of the products: held against the noise engine's.
TEST(ColumnWavelets, GiveTheWaveletVarianceOfAnyCombinationOfTheColumns) {
  const auto rows = two_columns(20'000);
  ColumnWavelets wavelets(2);
  std::vector<double> combination;
  for (const auto& row : rows) {
    wavelets.add(row);
    combination.push_back(2.0 * row[0] - 3.0 * row[1]);
  }
  const auto exact = noise::haar_wavelet_variance(combination).value();
  const Eigen::Vector2d a(2.0, -3.0);
  const auto levels = wavelets.levels();
  ASSERT_GE(levels.size(), 8U);
  EXPECT_EQ(levels.front().level, ColumnWavelets::kBlockLevel + 1);
  for (const auto& level : levels) {
    const double expected = exact.levels[static_cast<std::size_t>(level.level - 1)].value;
    // Of every coefficient of the exact one a part is used: 5 % at scales with many of them.
    if (level.level > 10) continue;
    EXPECT_NEAR(a.dot(level.products * a), expected, 0.05 * expected) << level.level;
  }
}

TEST(ColumnWavelets, MissingRowsCountAsTheNoiseEngineCountsThem) {
  const auto rows = two_columns(20'000);
  ColumnWavelets wavelets(2);
  std::vector<double> column;
  std::vector<std::uint8_t> mask;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const bool missing = i % 100 == 50 || (i >= 9000 && i < 9400);
    if (missing) {
      wavelets.skip();
    } else {
      wavelets.add(rows[i]);
    }
    column.push_back(rows[i][0]);
    mask.push_back(missing ? 0 : 1);
  }
  noise::WvOptions options;
  options.mask = mask;
  const auto exact = noise::haar_wavelet_variance(column, options).value();
  const auto levels = wavelets.levels();
  ASSERT_EQ(levels.back().level, exact.levels.back().level);
  for (const auto& level : levels) {
    if (level.level > 10) continue;
    const double expected = exact.levels[static_cast<std::size_t>(level.level - 1)].value;
    EXPECT_NEAR(level.products(0, 0), expected, 0.05 * expected) << level.level;
  }
}

TEST(ColumnWavelets, TooFewRowsGiveNoScale) {
  ColumnWavelets wavelets(2);
  for (const auto& row : two_columns(31)) wavelets.add(row);
  EXPECT_TRUE(wavelets.levels().empty());
}

}  // namespace
}  // namespace imuscope
