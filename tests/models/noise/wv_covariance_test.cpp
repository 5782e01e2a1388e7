#include "models/noise/wv_covariance.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <string>

#include "oracle_files.h"
#include "tests/support/shared_data.h"

namespace imuscope::noise {
namespace {

using test::read_table;

WaveletVariance counts_only(std::size_t n, int levels, std::vector<Segment> segments = {}) {
  WaveletVariance wv;
  wv.n_samples = n;
  wv.segments = std::move(segments);
  if (wv.segments.empty()) wv.segments = {{0, n}};
  for (int j = 1; j <= levels; ++j) {
    WvLevel level;
    level.level = j;
    level.tau_samples = std::ldexp(1.0, j);
    const auto width = std::size_t{1} << static_cast<unsigned>(j);
    for (const Segment& s : wv.segments) {
      if (s.end - s.begin >= width) level.n_coefficients += s.end - s.begin - width + 1;
    }
    wv.levels.push_back(level);
  }
  return wv;
}

Model model_of(std::vector<Component> components) { return Model{std::move(components)}; }

/// Haar filter of a level, oldest sample first.
std::vector<double> taps(int level) {
  const std::size_t n = std::size_t{1} << static_cast<unsigned>(level - 1);
  std::vector<double> h(2 * n, -1.0 / static_cast<double>(2 * n));
  for (std::size_t i = n; i < 2 * n; ++i) h[i] = -h[i];
  return h;
}

/// C_jk(lag) as the double sum over both filters of a stationary process's autocovariance.
template <typename G>
double by_double_sum(int j, int k, long lag, const G& autocovariance) {
  const auto hj = taps(j);
  const auto hk = taps(k);
  double sum = 0.0;
  // The newest samples are t and t + lag.
  for (std::size_t a = 0; a < hj.size(); ++a) {
    for (std::size_t b = 0; b < hk.size(); ++b) {
      const long ta = static_cast<long>(a) - static_cast<long>(hj.size()) + 1;
      const long tb = lag + static_cast<long>(b) - static_cast<long>(hk.size()) + 1;
      sum += hj[a] * hk[b] * autocovariance(std::abs(tb - ta));
    }
  }
  return sum;
}

TEST(WvCovariance, CoefficientCovariancesOfEveryProcessFollowFromTheirAutocovariances) {
  const auto check = [](const Model& model, const auto& autocovariance, const std::string& name) {
    for (const int j : {1, 2, 4}) {
      for (const int k : {1, 3, 5}) {
        for (long lag = -40; lag <= 60; ++lag) {
          const double expected = by_double_sum(j, k, lag, autocovariance);
          EXPECT_NEAR(coefficient_covariance(model, j, k, static_cast<double>(lag)), expected, 1e-9)
              << name << " levels " << j << ", " << k << " lag " << lag;
        }
      }
    }
  };
  check(
      model_of({{ProcessKind::kWhiteNoise, 2.0, {}}}), [](long h) { return h == 0 ? 2.0 : 0.0; }, "WN");
  check(
      model_of({{ProcessKind::kQuantization, 1.5, {}}}),
      [](long h) { return h == 0   ? 3.0
                          : h == 1 ? -1.5
                                   : 0.0; }, "QN");
  // The constant part of a random walk's covariance drops out: -|h|/2 stands for it.
  check(
      model_of({{ProcessKind::kRandomWalk, 0.7, {}}}), [](long h) { return -0.35 * static_cast<double>(h); },
      "RW");
  for (const double a : {2.0, 0.1, 1e-3, 1e-7}) {
    check(
        model_of({{ProcessKind::kGaussMarkov, 1.3, {a, 0}}}),
        [a](long h) { return 1.3 * std::exp(-a * static_cast<double>(h)); }, "GM a = " + std::to_string(a));
  }
  check(
      model_of({{ProcessKind::kMa1, 1.1, {-0.6, 0}}}),
      [](long h) { return h == 0   ? 1.1 * 1.36
                          : h == 1 ? -1.1 * 0.6
                                   : 0.0; }, "MA1");
  for (const auto& [a, b] : {std::pair{0.3, 1.1}, {0.02, 0.2}}) {
    check(
        model_of({{ProcessKind::kResonance, 1.2, {a, b}}}),
        [a = a, b = b](long h) {
          const auto m = static_cast<double>(h);
          return 1.2 * std::exp(-a * m) * (std::cos(b * m) + a / b * std::sin(b * m));
        },
        "RES a = " + std::to_string(a));
  }
  for (const double phi : {-0.7, 0.8}) {
    check(
        model_of({{ProcessKind::kArma11, 1.0, {phi, 0.4}}}),
        [phi](long h) {
          const double d = 1.0 - phi * phi;
          if (h == 0) return (1.0 + 0.16 + 0.8 * phi) / d;
          return (1.0 + 0.4 * phi) * (phi + 0.4) / d * std::pow(phi, static_cast<double>(h - 1));
        },
        "ARMA11 phi = " + std::to_string(phi));
  }
}

/// The same formula with every lag and every pair counted one by one.
double exact_covariance(const Model& model, double ramp, const WaveletVariance& wv, std::size_t j,
                        std::size_t k) {
  const auto valid = [&](const WvLevel& level) {
    std::vector<char> v(wv.n_samples, 0);
    for (const Segment& s : wv.segments) {
      for (auto t = s.begin + static_cast<std::size_t>(level.tau_samples) - 1; t < s.end; ++t) v[t] = 1;
    }
    return v;
  };
  const auto vj = valid(wv.levels[j]);
  const auto vk = valid(wv.levels[k]);
  const long n = static_cast<long>(wv.n_samples);
  const double means = ramp * ramp * wv.levels[j].tau_samples * wv.levels[k].tau_samples / 16.0;
  double sum = 0.0;
  for (long h = -n; h <= n; ++h) {
    double pairs = 0.0;
    for (long t = std::max(0L, -h); t < std::min(n, n - h); ++t) {
      pairs += vj[static_cast<std::size_t>(t)] * vk[static_cast<std::size_t>(t + h)];
    }
    if (pairs == 0.0) continue;
    const double c =
        coefficient_covariance(model, wv.levels[j].level, wv.levels[k].level, static_cast<double>(h));
    sum += pairs * (2.0 * c * c + 4.0 * means * c);
  }
  return sum / static_cast<double>(wv.levels[j].n_coefficients * wv.levels[k].n_coefficients);
}

/// Part of the covariance that q2 = 1 owes to the fourth cumulant (excess kurtosis -6/5) of uniform numbers.
double exact_uniform_part(const WaveletVariance& wv, std::size_t j, std::size_t k) {
  const auto weights = [&](const WvLevel& level) {
    std::vector<double> a(wv.n_samples + 1, 0.0);
    const auto n = static_cast<std::size_t>(0.5 * level.tau_samples);
    for (const Segment& s : wv.segments) {
      for (std::size_t t = s.begin + 2 * n; t <= s.end; ++t) {
        a[t] += 1.0 / (4.0 * static_cast<double>(n * n));
        a[t - n] += 4.0 / (4.0 * static_cast<double>(n * n));
        a[t - 2 * n] += 1.0 / (4.0 * static_cast<double>(n * n));
      }
    }
    return a;
  };
  const auto aj = weights(wv.levels[j]);
  const auto ak = weights(wv.levels[k]);
  double sum = 0.0;
  for (std::size_t i = 0; i < aj.size(); ++i) sum += aj[i] * ak[i];
  return -1.2 * sum / static_cast<double>(wv.levels[j].n_coefficients * wv.levels[k].n_coefficients);
}

TEST(WvCovariance, TheSumByBlocksAgreesWithTheSumOverEveryLag) {
  const std::vector<std::pair<std::string, Model>> models{
      {"WN", model_of({{ProcessKind::kWhiteNoise, 1.0, {}}})},
      {"QN+WN+RW", model_of({{ProcessKind::kQuantization, 1.0, {}},
                             {ProcessKind::kWhiteNoise, 0.09, {}},
                             {ProcessKind::kRandomWalk, 1e-3, {}}})},
      {"WN+2GM", model_of({{ProcessKind::kWhiteNoise, 1.0, {}},
                           {ProcessKind::kGaussMarkov, 0.5, {0.1, 0}},
                           {ProcessKind::kGaussMarkov, 0.8, {0.004, 0}}})},
      {"WN+RES",
       model_of({{ProcessKind::kWhiteNoise, 0.1, {}}, {ProcessKind::kResonance, 1.0, {0.08, 1.2}}})},
      {"ARMA11", model_of({{ProcessKind::kArma11, 1.0, {-0.8, 0.3}}})}};
  for (const auto& segments :
       {std::vector<Segment>{{0, 1500}}, std::vector<Segment>{{0, 600}, {650, 900}, {1000, 1500}}}) {
    const auto wv = counts_only(1500, 9, segments);
    for (const auto& [name, model] : models) {
      const auto v = wv_covariance(model, wv, wv.levels.size());
      for (std::size_t j = 0; j < wv.levels.size(); j += 2) {
        for (std::size_t k = 0; k <= j; ++k) {
          const double q2 = model.components[0].kind == ProcessKind::kQuantization ? 1.0 : 0.0;
          const double expected = exact_covariance(model, 0.0, wv, j, k) + q2 * exact_uniform_part(wv, j, k);
          const double scale = std::sqrt(v(static_cast<long>(j), static_cast<long>(j)) *
                                         v(static_cast<long>(k), static_cast<long>(k)));
          EXPECT_NEAR(v(static_cast<long>(j), static_cast<long>(k)), expected, 3e-3 * scale)
              << name << " levels " << j + 1 << ", " << k + 1 << " with " << segments.size() << " segments";
        }
      }
    }
  }
}

TEST(WvCovariance, ARampAddsOnlyTheProductOfMeansToTheVariance) {
  const auto wv = counts_only(1200, 8);
  const auto noise = model_of({{ProcessKind::kWhiteNoise, 1.0, {}}});
  const double omega = 0.01;
  const auto both = model_of({{ProcessKind::kWhiteNoise, 1.0, {}}, {ProcessKind::kRamp, omega * omega, {}}});
  const auto v = wv_covariance(both, wv, 8);
  for (std::size_t j = 0; j < 8; ++j) {
    const double expected = exact_covariance(noise, omega, wv, j, j);
    EXPECT_NEAR(v(static_cast<long>(j), static_cast<long>(j)) / expected, 1.0, 3e-3) << "level " << j + 1;
  }
}

// Monte Carlo of 1500 series: the relative error of an equivalent dof is about sqrt((2 + 12/dof) / 1500).
TEST(WvCovariance, EquivalentDegreesOfFreedomAgreeWithSimulatedSeries) {
  IMUSCOPE_NEEDS_SHARED("oracle/gmwm/ci_eta3_coverage.csv");
  const std::map<std::string, Model> models{
      {"WN", model_of({{ProcessKind::kWhiteNoise, 1.0, {}}})},
      {"QN", model_of({{ProcessKind::kQuantization, 1.0, {}}})},
      {"RW", model_of({{ProcessKind::kRandomWalk, 1.0, {}}})},
      {"GM a=0.01", model_of({{ProcessKind::kGaussMarkov, 1.0, {0.01, 0}}})}};
  const auto wv = counts_only(4096, 11);
  int compared = 0;
  for (auto& row : read_table("ci_eta3_coverage.csv")) {
    const Model& model = models.at(row["process"]);
    const auto v = wv_covariance(model, wv, 11);
    const int j = std::stoi(row["j"]);
    const double value = model_wv(model, j);
    const double dof = 2.0 * value * value / v(j - 1, j - 1);
    const double expected = std::stod(row["equiv_dof_true"]);
    EXPECT_NEAR(dof / expected, 1.0, 4.0 * std::sqrt((2.0 + 12.0 / expected) / 1500.0))
        << row["process"] << " level " << j;
    ++compared;
  }
  EXPECT_EQ(compared, 44);
}

TEST(WvCovariance, LongSeriesOfWhiteNoiseHasThreeTimesTheClassicalDegreesOfFreedom) {
  const auto wv = counts_only(1U << 24U, 14);
  const auto model = model_of({{ProcessKind::kWhiteNoise, 1.0, {}}});
  const auto v = wv_covariance(model, wv, 14);
  const double value = model_wv(model, 12);
  const double eta = static_cast<double>(wv.levels[11].n_coefficients) / 4096.0;
  EXPECT_NEAR(2.0 * value * value / v(11, 11) / eta, 3.0, 0.01);
}

// Robust estimates of simulated Gauss-Markov series: the variance of their logarithm, 600 series, has a
// relative error of sqrt(2/600) = 6 %. Dividing by the efficiency alone is wrong by up to a third where
// coefficients are correlated.
TEST(WvCovariance, OfTheRobustEstimatorAgreesWithSimulatedSeries) {
  constexpr int kSeries = 600;
  constexpr std::size_t kLength = 4096;
  constexpr std::size_t kLevels = 8;
  const double phi = std::exp(-0.05);
  const auto model =
      model_of({{ProcessKind::kWhiteNoise, 0.2, {}}, {ProcessKind::kGaussMarkov, 1.0, {0.05, 0}}});
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  WvOptions options;
  options.robust = RobustOptions{};
  options.levels = static_cast<int>(kLevels);
  std::vector<double> x(kLength);
  Eigen::MatrixXd values(kSeries, static_cast<Eigen::Index>(kLevels));
  for (int s = 0; s < kSeries; ++s) {
    double state = normal(random);
    for (double& v : x) {
      v = state + std::sqrt(0.2) * normal(random);
      state = phi * state + std::sqrt(1.0 - phi * phi) * normal(random);
    }
    const auto wv = haar_wavelet_variance(x, options).value();
    for (std::size_t j = 0; j < kLevels; ++j) values(s, static_cast<Eigen::Index>(j)) = wv.levels[j].value;
  }
  auto counts = counts_only(kLength, static_cast<int>(kLevels));
  counts.efficiency = 0.6;
  const auto v = wv_covariance(model, counts, kLevels);
  const Eigen::MatrixXd centred = values.rowwise() - values.colwise().mean();
  const Eigen::MatrixXd simulated = centred.transpose() * centred / (kSeries - 1);
  for (Eigen::Index j = 0; j < v.rows(); ++j) {
    EXPECT_NEAR(v(j, j) / simulated(j, j), 1.0, 4.0 * std::sqrt(2.0 / kSeries)) << "level " << j + 1;
  }
  EXPECT_NEAR(v(1, 2) / simulated(1, 2), 1.0, 0.35);
}

}  // namespace
}  // namespace imuscope::noise
