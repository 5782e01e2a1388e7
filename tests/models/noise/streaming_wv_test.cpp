#include "models/noise/streaming_wv.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "models/noise/replicates.h"

namespace imuscope::noise {
namespace {

std::vector<double> walk_and_noise(std::size_t n, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<double> x(n);
  double walk = 1e3;
  for (double& v : x) v = (walk += 0.01 * normal(random)) + normal(random);
  return x;
}

void expect_equal(const WaveletVariance& streamed, const WaveletVariance& batch) {
  ASSERT_EQ(streamed.levels.size(), batch.levels.size());
  for (std::size_t i = 0; i < batch.levels.size(); ++i) {
    EXPECT_EQ(streamed.levels[i].n_coefficients, batch.levels[i].n_coefficients) << "level " << i + 1;
    EXPECT_NEAR(streamed.levels[i].value / batch.levels[i].value, 1.0, 1e-12) << "level " << i + 1;
    EXPECT_NEAR(streamed.levels[i].ci_low / batch.levels[i].ci_low, 1.0, 1e-12) << "level " << i + 1;
  }
}

TEST(StreamingWv, EqualsTheBatchResultOverALongSeries) {
  const auto x = walk_and_noise(200000, 1);
  StreamingWv stream;
  for (const double v : x) stream.push(v);
  WvOptions options;
  options.levels = 16;
  expect_equal(stream.wavelet_variance(), haar_wavelet_variance(x, options).value());
}

TEST(StreamingWv, EqualsTheMaskedBatchResultOverMissingSamplesNotANumberAndOtherRegimes) {
  auto x = walk_and_noise(20000, 2);
  std::vector<std::uint8_t> mask(x.size(), 1);
  std::mt19937_64 random(7);
  for (std::size_t i = 1; i + 1 < x.size(); ++i) {
    const bool other_regime = (i >= 2000 && i < 2300) || (i >= 9000 && i < 14000);
    if (other_regime || random() % 50 == 0) mask[i] = 0;
  }
  StreamingWv stream({11, 0.0, 0.95});
  stream.miss(5);  // before the first sample nothing is missing
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (mask[i] != 0)
      stream.push(x[i]);
    else if (i % 2 == 0)
      stream.push(std::numeric_limits<double>::quiet_NaN());
    else
      stream.miss(1);
  }
  stream.miss(100);  // after the last one neither
  WvOptions options;
  options.levels = 11;
  options.mask = mask;
  const auto batch = haar_wavelet_variance(x, options).value();
  expect_equal(stream.wavelet_variance(), batch);
  for (std::size_t i = 0; i < batch.levels.size(); ++i)
    EXPECT_NEAR(stream.wavelet_variance().levels[i].inflation, batch.levels[i].inflation, 1e-10);
  EXPECT_GT(batch.levels[5].inflation, 1.01);
}

TEST(StreamingWv, MergedSumsOfTwoStretchesEqualTheirBatchesPooled) {
  const auto x = walk_and_noise(3000, 3);
  StreamingWv first({9, 0.0, 0.95});
  for (std::size_t i = 0; i < 1234; ++i) first.push(x[i]);
  first.gap();
  for (std::size_t i = 1234; i < x.size(); ++i) first.push(x[i]);
  StreamingWv second({9, 0.0, 0.95});
  for (std::size_t i = 100; i < 2000; ++i) second.push(x[i]);
  WvOptions options;
  options.levels = 9;
  const std::span<const double> all(x);
  const auto batch = [&](std::size_t begin, std::size_t end) {
    return haar_wavelet_variance(all.subspan(begin, end - begin), options).value();
  };
  WvSums sums = first.sums();
  sums.merge(second.sums());
  expect_equal(sums.wavelet_variance(),
               pool(std::vector{batch(0, 1234), batch(1234, 3000), batch(100, 2000)}));
}

TEST(StreamingWv, HasOnlyTheLevelsThatTheSamplesSoFarAllow) {
  StreamingWv stream;
  EXPECT_TRUE(stream.wavelet_variance().levels.empty());
  stream.push(1.0);
  EXPECT_TRUE(stream.wavelet_variance().levels.empty());
  stream.push(3.0);
  ASSERT_EQ(stream.wavelet_variance().levels.size(), 1U);
  EXPECT_DOUBLE_EQ(stream.wavelet_variance().levels[0].value, 1.0);
  stream.reset();
  EXPECT_TRUE(stream.wavelet_variance().levels.empty());
}

TEST(StreamingWv, ForgetsWithTheTimeConstantItWasGiven) {
  std::mt19937_64 random(4);
  std::normal_distribution<double> normal;
  constexpr double kTimeConstant = 2000.0;
  StreamingWv stream({4, 1.0 / kTimeConstant, 0.95});
  for (int i = 0; i < 40000; ++i) stream.push(10.0 * normal(random));
  for (int i = 0; i < 40000; ++i) stream.push(normal(random));
  const auto wv = stream.wavelet_variance();
  // 20 time constants later the loud part weighs exp(-20); (sum w)^2 / sum w^2 tends to 2 n - 1.
  EXPECT_NEAR(static_cast<double>(wv.levels[0].n_coefficients), 2.0 * kTimeConstant - 1.0, 1.0);
  EXPECT_NEAR(wv.levels[0].value, 0.5, 0.5 * 4.0 * std::sqrt(3.0 / (2.0 * kTimeConstant)));
}

TEST(StreamingWv, ASlidingWindowHoldsExactlyTheCoefficientsThatEndInIt) {
  const auto x = walk_and_noise(1000, 5);
  WindowedWv window(5, 100, 3);
  int completed = 0;
  for (std::size_t i = 0; i < 950; ++i) completed += window.push(x[i]) ? 1 : 0;
  EXPECT_EQ(completed, 9);
  const auto wv = window.wavelet_variance();
  ASSERT_EQ(wv.levels.size(), 5U);
  for (const auto& level : wv.levels) {
    // The coefficients that end at samples 600..899 are those of the stretch that begins one support earlier.
    const auto from = static_cast<std::size_t>(600 - (static_cast<int>(level.tau_samples) - 1));
    WvOptions options;
    options.levels = level.level;
    const auto batch =
        haar_wavelet_variance(std::span(x).subspan(from, 900 - from), options).value().levels.back();
    EXPECT_EQ(level.n_coefficients, 300U);
    EXPECT_NEAR(level.value / batch.value, 1.0, 1e-10) << "level " << level.level;
  }
}

}  // namespace
}  // namespace imuscope::noise
