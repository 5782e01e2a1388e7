#include "models/noise/wavelet_variance.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <random>
#include <string>

#include "made_series.h"
#include "models/noise/robust_scale.h"
#include "oracle_files.h"
#include "tests/support/shared_data.h"

namespace imuscope::noise {
namespace {

using test::read_series;
using test::read_table;
using test::relative;
using test::white;
using testing::HasSubstr;

std::vector<double> integers_of_s07() {
  std::vector<double> x;
  for (int t = 0; t < 1000; ++t) x.push_back((7919 * t) % 101 - 50);
  return x;
}

/// Straight from the definition, in long double.
double by_definition(const std::vector<double>& x, int level) {
  const std::size_t n = std::size_t{1} << static_cast<unsigned>(level - 1);
  long double sum = 0;
  std::size_t count = 0;
  for (std::size_t t = 2 * n; t <= x.size(); ++t, ++count) {
    long double newer = 0;
    long double older = 0;
    for (std::size_t i = 0; i < n; ++i) {
      newer += x[t - 1 - i];
      older += x[t - 1 - n - i];
    }
    const long double w = (newer - older) / static_cast<long double>(2 * n);
    sum += w * w;
  }
  return static_cast<double>(sum / static_cast<long double>(count));
}

TEST(WaveletVariance, AgreesWithItsDefinitionOnWhiteNoiseOfOddLength) {
  const auto x = white(1013, 1);
  const auto wv = haar_wavelet_variance(x);
  ASSERT_TRUE(wv) << wv.error().text();
  ASSERT_EQ(wv->levels.size(), 9U);
  for (const auto& level : wv->levels) {
    EXPECT_LT(relative(level.value, by_definition(x, level.level)), 1e-13) << "level " << level.level;
    EXPECT_EQ(level.n_coefficients, x.size() - (std::size_t{1} << static_cast<unsigned>(level.level)) + 1);
  }
}

/// The same by sums from the beginning, in long double: quick for long supports.
double by_sums(const std::vector<double>& x, int level) {
  std::vector<long double> sums{0};
  for (const double value : x) sums.push_back(sums.back() + value);
  const std::size_t n = std::size_t{1} << static_cast<unsigned>(level - 1);
  long double squares = 0;
  for (std::size_t t = 2 * n; t <= x.size(); ++t) {
    const long double w = (sums[t] - 2 * sums[t - n] + sums[t - 2 * n]) / static_cast<long double>(2 * n);
    squares += w * w;
  }
  return static_cast<double>(squares / static_cast<long double>(x.size() - 2 * n + 1));
}

void expect_sums_at_every_level(std::size_t length) {
  const auto x = white(length, 5);
  const auto wv = haar_wavelet_variance(x);
  ASSERT_TRUE(wv) << wv.error().text();
  ASSERT_EQ(wv->levels.size(), static_cast<std::size_t>(std::bit_width(length)) - 1);
  for (const auto& level : wv->levels) {
    EXPECT_LT(relative(level.value, by_sums(x, level.level)), 1e-12) << length << ", level " << level.level;
    EXPECT_EQ(level.n_coefficients, length - (std::size_t{1} << static_cast<unsigned>(level.level)) + 1);
  }
}

TEST(WaveletVariance, LengthsAboutTheEndsOfTilesAgreeWithTheDefinition) {
  // Tiles of 1024 samples, steps of eight: a last tile of every length up to two steps, and one that is not full.
  for (const std::size_t tiles : {1U, 2U, 3U, 8U, 32U}) {
    for (std::size_t more = 0; more <= 16; ++more) expect_sums_at_every_level(1024 * tiles + more);
    for (std::size_t less = 1; less <= 9; ++less) expect_sums_at_every_level(1024 * tiles - less);
  }
}

TEST(WaveletVariance, LongSupportsThatAreTakenInStripsAgreeWithTheDefinitionWhateverTheLength) {
  // One sum of 32768 samples beyond the low levels, and a few more or less; strips with a row more than others, and
  // with none; strips narrower than the others, and not as wide as a line of the cache.
  for (const std::size_t length :
       {8192U, 12'289U, 40'961U, 65'535U, 65'536U, 65'537U, 65'543U, 65'544U, 98'303U, 98'304U, 98'305U,
        98'313U, 131'071U, 131'072U, 200'003U, 524'289U})
    expect_sums_at_every_level(length);
}

TEST(WaveletVariance, ASampleThatIsNoNumberIsToldWhereverItStands) {
  for (const std::size_t length : {2U, 1030U, 70'000U}) {
    for (const std::size_t place : {std::size_t{0}, std::size_t{1}, length / 2, length - 1}) {
      for (const double no_number :
           {std::numeric_limits<double>::quiet_NaN(), -std::numeric_limits<double>::infinity()}) {
        auto x = white(length, 6);
        x[place] = no_number;
        const std::string told = "sample " + std::to_string(place) + " (counted from 0)";
        const auto refused = haar_wavelet_variance(x);
        ASSERT_FALSE(refused) << length;
        EXPECT_THAT(refused.error().text(), HasSubstr(told));
        const auto refused_in_place = haar_wavelet_variance_in_place(x);
        ASSERT_FALSE(refused_in_place) << length;
        EXPECT_THAT(refused_in_place.error().text(), HasSubstr(told));
      }
    }
  }
}

TEST(WaveletVariance, SquaresBeyondAllNumbersAreNoReasonToRefuseSamplesThatAreNumbers) {
  auto x = white(100, 6);
  x[50] = 1e200;
  const auto wv = haar_wavelet_variance(x);
  ASSERT_TRUE(wv) << wv.error().text();
  EXPECT_TRUE(std::isinf(wv->levels.front().value));
}

TEST(WaveletVariance, EveryClassicalLevelAndIntervalOfTheOracleIsReproducedTo1em10) {
  IMUSCOPE_NEEDS_SHARED("oracle/gmwm/wv_oracle.csv");
  std::map<std::string, WaveletVariance> computed;
  int compared = 0;
  for (auto& row : read_table("wv_oracle.csv")) {
    if (row["type"] != "classical") continue;
    const std::string& name = row["series"];
    if (!computed.contains(name)) {
      const auto x = name == "s07_integer_n1000" ? integers_of_s07() : read_series(name);
      ASSERT_FALSE(x.empty()) << "series " << name << " is missing";
      computed[name] = haar_wavelet_variance(x).value();
    }
    const auto& level = computed[name].levels.at(static_cast<std::size_t>(std::stoi(row["j"]) - 1));
    EXPECT_LT(relative(level.value, std::stod(row["wv"])), 1e-10) << name << " level " << row["j"];
    EXPECT_LT(relative(level.ci_low, std::stod(row["ci_low"])), 1e-10) << name << " level " << row["j"];
    EXPECT_LT(relative(level.ci_high, std::stod(row["ci_high"])), 1e-10) << name << " level " << row["j"];
    EXPECT_EQ(level.n_coefficients, std::stoull(row["n_coef"])) << name << " level " << row["j"];
    ++compared;
  }
  EXPECT_GE(compared, 237);
}

void expect_roots(const std::string& table, const RobustOptions& robust, double tolerance) {
  std::map<std::string, WaveletVariance> computed;
  for (auto& row : read_table(table)) {
    const std::string& name = row["series"];
    if (!computed.contains(name)) {
      const auto x = name == "s07_integer_n1000" ? integers_of_s07() : read_series(name);
      ASSERT_FALSE(x.empty()) << "series " << name << " is missing";
      WvOptions options;
      options.robust = robust;
      computed[name] = haar_wavelet_variance(x, options).value();
    }
    const auto& level = computed[name].levels.at(static_cast<std::size_t>(std::stoi(row["j"]) - 1));
    EXPECT_LT(relative(level.value, std::stod(row["robust_wv_exact_root"])), tolerance)
        << name << " level " << row["j"];
  }
  EXPECT_GE(computed.size(), 9U);
}

TEST(WaveletVariance, RobustLevelsAreTheRootsOfTheEstimatingEquationWithTheRightConstant) {
  IMUSCOPE_NEEDS_SHARED("oracle/gmwm/robust_wv_root_correct_c.csv");
  expect_roots("robust_wv_root_correct_c.csv", {}, 1e-9);
}

TEST(WaveletVariance, RobustLevelsWithTheOtherSoftwaresConstantAreItsRoots) {
  IMUSCOPE_NEEDS_SHARED("oracle/gmwm/robust_wv_root_pkg_constant.csv");
  // The constant is given to 10 digits.
  expect_roots("robust_wv_root_pkg_constant.csv", {0.6, 4.973362134}, 1e-8);
}

// Quadrature to 40 digits, rounded.
TEST(RobustScale, TuningConstantsHaveTheEfficiencyTheyPromise) {
  EXPECT_NEAR(biweight_constant(0.60), 4.400278056, 2e-9);
  EXPECT_NEAR(biweight_constant(0.80), 5.448855123, 2e-9);
  EXPECT_NEAR(biweight_constant(0.90), 6.583978572, 2e-9);
  EXPECT_NEAR(biweight_constant(0.95), 7.878543797, 2e-9);
  EXPECT_NEAR(biweight_expectation(4.400278056), 0.5691688598, 2e-10);
  EXPECT_NEAR(biweight_efficiency(4.973362134), 0.7270, 5e-5);
}

TEST(RobustScale, EfficiencyOnGaussianDrawsIsTheOnePromised) {
  const double c = biweight_constant(0.6);
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  constexpr int kDraws = 2000;
  constexpr std::size_t kLength = 400;
  double mean = 0;
  double square = 0;
  std::vector<double> w(kLength);
  for (int i = 0; i < kDraws; ++i) {
    for (double& v : w) v = normal(random);
    const double s2 = biweight_scale(w, c).s2;
    mean += s2 / kDraws;
    square += s2 * s2 / kDraws;
  }
  const double efficiency = (2.0 / kLength) / (square - mean * mean);
  // The sampling error of a variance from 2000 draws is 3.2 %.
  EXPECT_NEAR(efficiency, 0.6, 0.06);
}

/// Scale that the estimating equation gives for N(0,1) of which `share` is replaced by rejected values.
double diluted_scale(double c, double share) {
  const auto excess = [&](double s2) {
    double mean = 0;
    constexpr double kStep = 1e-3;
    for (double z = -10.0; z < 10.0; z += kStep) {
      const double y = z * z / (s2 * c * c);
      if (y < 1.0) mean += z * z / s2 * std::pow(1.0 - y, 4) * std::exp(-0.5 * z * z) * kStep;
    }
    return (1.0 - share) * mean / std::sqrt(2.0 * std::acos(-1.0)) - biweight_expectation(c);
  };
  double low = 0.4;
  double high = 1.2;
  while (high - low > 1e-6) (excess(0.5 * (low + high)) > 0 ? low : high) = 0.5 * (low + high);
  return low;
}

TEST(WaveletVariance, RobustLevelsOneToThreeSurviveOnePercentOfSpikesOf1e4) {
  auto x = white(4096, 3);
  for (std::size_t i = 50; i < x.size(); i += 100) x[i] += 1e4;
  WvOptions options;
  options.robust = RobustOptions{};
  options.levels = 3;
  const auto wv = haar_wavelet_variance(x, options).value();
  const double c = biweight_constant(0.6);
  for (const auto& level : wv.levels) {
    const double share = level.tau_samples / 100.0;  // a spike spoils 2^level coefficients
    EXPECT_NEAR(level.rejected_share, share, 0.002);
    const double expected = diluted_scale(c, share) / level.tau_samples;
    const double sd = expected * std::sqrt(2.0 * level.tau_samples / 3.0 / 4096.0 / 0.6);
    EXPECT_NEAR(level.value, expected, 4.0 * sd) << "level " << level.level;
  }
}

/// Mean of r^2 (1 - (r/c)^2)^4 at scale s2, as the definition has it.
double mean_chi(const std::vector<double>& w, double s2, double c) {
  double sum = 0.0;
  for (const double v : w) {
    const double y = 1.0 - v * v / s2 / (c * c);
    if (y > 0.0) sum += v * v / s2 * std::pow(y, 4);
  }
  return sum / static_cast<double>(w.size());
}

TEST(RobustScale, WhereTheEquationHasNoRootIsTheScaleThatComesClosest) {
  // Amplitudes spread evenly over six decades have at no scale enough of them in reach.
  constexpr double kC = 4.400278056;
  std::vector<double> w;
  for (int i = 0; i < 600; ++i) w.push_back(std::pow(10.0, 0.01 * i));
  const double s2 = biweight_scale(w, kC).s2;
  ASSERT_GT(s2, 0.0);
  ASSERT_LT(mean_chi(w, s2, kC), biweight_expectation(kC)) << "this case is meant to have no root";
  for (double other = 1e-2; other < 1e13; other *= 1.01) {
    EXPECT_LE(mean_chi(w, other, kC), mean_chi(w, s2, kC) * (1.0 + 1e-3)) << other;
  }
}

TEST(WaveletVariance, RobustLevelsOfAPureRampAreNotZero) {
  std::vector<double> x(3000);
  std::iota(x.begin(), x.end(), 0.0);
  WvOptions options;
  options.robust = RobustOptions{};
  const auto wv = haar_wavelet_variance(x, options).value();
  const auto classical = haar_wavelet_variance(x).value();
  for (std::size_t i = 0; i < wv.levels.size(); ++i) {
    EXPECT_GT(wv.levels[i].value, 0.5 * classical.levels[i].value) << "level " << i + 1;
    EXPECT_DOUBLE_EQ(classical.levels[i].value, std::pow(4.0, static_cast<double>(i + 1)) / 16.0);
  }
}

TEST(WaveletVariance, AnOffsetThatTheInputCarriesExactlyChangesNothing) {
  auto x = white(5000, 4);
  for (double& v : x) v = std::round(v * 1024.0) / 1024.0;  // so that the sum with 2^30 is exact
  auto shifted = x;
  for (double& v : shifted) v += 1073741824.0;
  const auto a = haar_wavelet_variance(x).value();
  const auto b = haar_wavelet_variance(shifted).value();
  for (std::size_t i = 0; i < a.levels.size(); ++i) {
    EXPECT_LT(relative(b.levels[i].value, a.levels[i].value), 1e-12) << "level " << i + 1;
  }
}

/// By G-1 and G-33, coefficient by coefficient: squares, count and mean excess of a level.
struct ByDefinition {
  double squares = 0.0;
  double own = 0.0;
  double common = 0.0;
  std::uint64_t count = 0;
};
ByDefinition by_definition(const std::vector<double>& x, const std::vector<std::uint8_t>& mask,
                           std::size_t n) {
  ByDefinition out;
  for (std::size_t t = 0; t + 2 * n <= x.size(); ++t) {
    double sums[2] = {0.0, 0.0};
    double there[2] = {0.0, 0.0};
    for (std::size_t i = 0; i < 2 * n; ++i) {
      if (mask[t + i] == 0) continue;
      sums[i / n] += x[t + i];
      there[i / n] += 1.0;
    }
    const auto all = static_cast<double>(n);
    const double least = all - std::floor(all / 8.0);
    if (there[0] < least || there[1] < least) continue;
    const double w = 0.5 * (sums[1] / there[1] - sums[0] / there[0]);
    out.squares += w * w;
    for (const double c : there) {
      out.own += 0.25 * (all - c) / (c * c);
      out.common += 0.25 * (all - c) * (all - c) / (c * c * all);
    }
    ++out.count;
  }
  return out;
}

TEST(WaveletVariance, HalfASupportBearsAnEighthOfMissingSamplesAndWhatTheyAddIsTakenOut) {
  const auto x = white(700, 5);
  std::vector<std::uint8_t> mask(x.size(), 1);
  mask[300] = 0;
  for (std::size_t i = 500; i < 520; ++i) mask[i] = 0;
  WvOptions options;
  options.mask = mask;
  const auto wv = haar_wavelet_variance(x, options).value();
  ASSERT_EQ(wv.levels.size(), 9U) << "of 700 samples, of which a half of 256 lacks 20 at most";
  std::vector<double> below;
  for (const auto& level : wv.levels) {
    const auto expected = by_definition(x, mask, static_cast<std::size_t>(level.tau_samples) / 2);
    const double raw = expected.squares / static_cast<double>(expected.count);
    // A hole of one sample, and from n = 256 on one of twenty as well, each for as many samples as it has.
    const double n = 0.5 * level.tau_samples;
    const auto above = [&](double m) {
      double sum = 0.0;
      for (std::size_t k = 0; k < below.size(); ++k)
        sum += below[k] * std::clamp(static_cast<double>(k) + 1.0 - std::log2(m), 0.0, 1.0);
      return m * sum / (1.0 - m / n);
    };
    const double within = n >= 160.0 ? (above(1.0) + 20.0 * above(20.0)) / 21.0 : above(1.0);
    const auto count = static_cast<double>(expected.count);
    const double value = expected.own > 0.0 ? raw - expected.own / count * within +
                                                  expected.common / count * above(std::max(1.0, n / 8.0))
                                            : raw;
    below.push_back(value);
    EXPECT_EQ(level.n_coefficients, expected.count) << "level " << level.level;
    EXPECT_LT(relative(level.value, value), 1e-12) << "level " << level.level;
    EXPECT_LT(relative(level.inflation, raw / value), 1e-12) << "level " << level.level;
  }
}

TEST(WaveletVariance, AValueThatIsNotFiniteIsToldWithItsPlaceOrCountsAsAGap) {
  auto x = white(100, 6);
  x[37] = std::numeric_limits<double>::quiet_NaN();
  const auto refused = haar_wavelet_variance(x);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text(), HasSubstr("sample 37"));
  WvOptions options;
  options.nan_is_gap = true;
  const auto wv = haar_wavelet_variance(x, options);
  ASSERT_TRUE(wv) << wv.error().text();
  EXPECT_EQ(wv->n_valid, 99U);
  EXPECT_EQ(wv->levels[0].n_coefficients, 36U + 61U);
}

TEST(WaveletVariance, OneSampleIsRefusedAndTwoGiveOneLevel) {
  EXPECT_FALSE(haar_wavelet_variance(std::vector<double>{1.0}));
  EXPECT_FALSE(haar_wavelet_variance(std::vector<double>{}));
  const auto wv = haar_wavelet_variance(std::vector<double>{1.0, 3.0});
  ASSERT_TRUE(wv);
  ASSERT_EQ(wv->levels.size(), 1U);
  EXPECT_DOUBLE_EQ(wv->levels[0].value, 1.0);
}

TEST(WaveletVariance, APowerOfTwoKeepsItsLastLevelWithOneCoefficient) {
  const auto x = white(64, 8);
  const auto wv = haar_wavelet_variance(x).value();
  ASSERT_EQ(wv.levels.size(), 6U);
  EXPECT_EQ(wv.levels.back().n_coefficients, 1U);
  EXPECT_LT(relative(wv.levels.back().value, by_definition(x, 6)), 1e-12);
}

TEST(WaveletVariance, AConstantSignalHasZeroAtEveryLevelClassicalAndRobust) {
  const std::vector<double> x(256, -3.25);
  WvOptions options;
  for (int pass = 0; pass < 2; ++pass) {
    const auto wv = haar_wavelet_variance(x, options).value();
    for (const auto& level : wv.levels) EXPECT_EQ(level.value, 0.0);
    options.robust = RobustOptions{};
  }
}

TEST(WaveletVariance, MoreLevelsThanTheDataAllowAreRefusedWithTheNumberThatWorks) {
  WvOptions options;
  options.levels = 11;
  const auto refused = haar_wavelet_variance(white(1000, 9), options);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text(), HasSubstr("at most 9"));
}

TEST(WaveletVariance, InPlaceIsTheSameToTheBit) {
  const std::vector<std::vector<Segment>> holes{{}, {{400, 403}}, {{17, 18}, {300, 420}, {423, 424}}};
  for (const std::size_t n : {std::size_t{1000}, std::size_t{100'003}}) {
    for (const auto& missing : holes) {
      auto x = white(n, 10);
      for (double& v : x) v += 1e3;
      std::vector<std::uint8_t> mask(n, 1);
      mask.front() = mask.back() = 0;
      for (const Segment& hole : missing) {
        for (std::size_t i = hole.begin; i < hole.end; ++i) {
          mask[i] = 0;
          x[i] = std::nan("");
        }
      }
      WvOptions options;
      options.mask = mask;
      const auto wv = haar_wavelet_variance(x, options).value();
      const auto in_place = haar_wavelet_variance_in_place(x, options).value();
      ASSERT_EQ(in_place.levels.size(), wv.levels.size());
      for (std::size_t i = 0; i < wv.levels.size(); ++i) {
        EXPECT_EQ(in_place.levels[i].value, wv.levels[i].value) << n << ", level " << i + 1;
        EXPECT_EQ(in_place.levels[i].n_coefficients, wv.levels[i].n_coefficients);
      }
    }
  }
}

TEST(WaveletVariance, AMeanOfSquaresLeavesNoneOut) {
  std::vector<double> values = white(1003, 12);
  SquareSum squares;
  double sum = 0.0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    squares.add(values[i]);
    sum += values[i] * values[i];
    EXPECT_NEAR(squares.mean(), sum / static_cast<double>(i + 1), 1e-12);
    EXPECT_EQ(squares.count(), i + 1);
  }
}

}  // namespace
}  // namespace imuscope::noise
