#include "noise/process.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <vector>

#include "made_series.h"
#include "oracle_files.h"
#include "tests/support/shared_data.h"

namespace imuscope::noise {
namespace {

using test::read_table;
using test::relative;

/// Also reads subnormal numbers, which std::stod refuses.
double number(const std::string& text) { return std::strtod(text.c_str(), nullptr); }

int level_of(const std::string& tau) { return static_cast<int>(std::lround(std::log2(number(tau)))); }

/// Wavelet variance of any stationary process from its autocovariances: half-length n, g(0..2n).
double from_autocovariance(const std::vector<double>& g, std::size_t n) {
  double sum = static_cast<double>(n) * (g[0] - g[n]);
  for (std::size_t i = 1; i < n; ++i) sum += static_cast<double>(i) * (2.0 * g[n - i] - g[i] - g[2 * n - i]);
  return sum / (2.0 * static_cast<double>(n) * static_cast<double>(n));
}

std::vector<double> arma_autocovariance(double phi, double theta, std::size_t count) {
  std::vector<double> g(count);
  g[0] = (1.0 + theta * theta + 2.0 * phi * theta) / (1.0 - phi * phi);
  g[1] = (1.0 + phi * theta) * (phi + theta) / (1.0 - phi * phi);
  for (std::size_t i = 2; i < count; ++i) g[i] = phi * g[i - 1];
  return g;
}

TEST(Process, GaussMarkovCurveAndDerivativeAgreeWithTheExactValuesTo1em13) {
  IMUSCOPE_NEEDS_SHARED("oracle/gmwm/gm_wv_exact.csv");
  const auto rows = read_table("gm_wv_exact.csv");
  ASSERT_GE(rows.size(), 260U);
  for (auto row : rows) {
    const auto point = gauss_markov_wv(number(row["a=beta*dt"]), level_of(row["tau"]));
    EXPECT_LT(relative(point.value, number(row["wv_exact_sigma2gm_1"])), 1e-13)
        << "a = " << row["a=beta*dt"] << " tau = " << row["tau"];
    EXPECT_LT(relative(point.derivative[0], number(row["d_wv_d_a"])), 1e-13)
        << "derivative at a = " << row["a=beta*dt"] << " tau = " << row["tau"];
  }
}

TEST(Process, GaussMarkovCurveKeepsItsDigitsWherePhiIsNearlyOne) {
  IMUSCOPE_NEEDS_SHARED("oracle/gmwm/ar1_cancellation.csv");
  const auto rows = read_table("ar1_cancellation.csv");
  ASSERT_GE(rows.size(), 50U);
  for (auto row : rows) {
    const auto point = gauss_markov_wv(number(row["a"]), level_of(row["tau"]));
    EXPECT_LT(relative(point.value, number(row["exact_wv_for_sigma2gm_1"])), 1e-13)
        << "a = " << row["a"] << " tau = " << row["tau"];
  }
}

TEST(Process, GaussMarkovCurveBecomesTheRandomWalkAsTheRateVanishes) {
  for (int level = 1; level <= 20; ++level) {
    const double a = 1e-14;
    const double gm = gauss_markov_wv(a, level).value / (2.0 * a);
    const double rw = unit_wv(ProcessKind::kRandomWalk, {}, level).value;
    EXPECT_LT(relative(gm, rw), 1e-7) << "level " << level;
  }
}

TEST(Process, StationaryCurvesFollowFromTheirAutocovariances) {
  constexpr std::size_t kLongest = 1024;
  for (int level = 1; level <= 10; ++level) {
    const std::size_t n = std::size_t{1} << static_cast<unsigned>(level - 1);
    for (const double theta : {-0.95, -0.4, 0.3, 0.9}) {
      const auto ma = arma_autocovariance(0.0, theta, kLongest + 1);
      EXPECT_LT(relative(unit_wv(ProcessKind::kMa1, {theta, 0}, level).value, from_autocovariance(ma, n)),
                1e-11);
      for (const double phi : {-0.9, -0.3, 0.2, 0.49, 0.51, 0.97}) {
        const auto g = arma_autocovariance(phi, theta, kLongest + 1);
        EXPECT_LT(
            relative(unit_wv(ProcessKind::kArma11, {phi, theta}, level).value, from_autocovariance(g, n)),
            1e-9)
            << "ARMA11 phi " << phi << " theta " << theta << " level " << level;
      }
    }
    for (const double b : {0.003, 0.4, 2.0, 3.1}) {
      std::vector<double> g(kLongest + 1);
      for (std::size_t i = 0; i < g.size(); ++i) g[i] = 0.5 * std::cos(b * static_cast<double>(i));
      EXPECT_NEAR(unit_wv(ProcessKind::kSinusoid, {b, 0}, level).value, from_autocovariance(g, n), 1e-12);
    }
  }
}

TEST(Process, DerivativesMatchCentralDifferences) {
  struct Case {
    ProcessKind kind;
    Shape shape;
  };
  const std::vector<Case> cases{{ProcessKind::kMa1, {0.4, 0}},        {ProcessKind::kMa1, {-0.8, 0}},
                                {ProcessKind::kSinusoid, {0.37, 0}},  {ProcessKind::kSinusoid, {0.011, 0}},
                                {ProcessKind::kArma11, {0.3, 0.2}},   {ProcessKind::kArma11, {-0.6, 0.7}},
                                {ProcessKind::kArma11, {0.95, -0.5}}, {ProcessKind::kGaussMarkov, {0.02, 0}}};
  for (const Case& c : cases) {
    for (const int level : {1, 3, 7, 11}) {
      for (int i = 0; i < shape_count(c.kind); ++i) {
        const auto k = static_cast<std::size_t>(i);
        const double h = 1e-6 * std::abs(c.shape[k]);
        Shape up = c.shape;
        Shape down = c.shape;
        up[k] += h;
        down[k] -= h;
        const double expected =
            (unit_wv(c.kind, up, level).value - unit_wv(c.kind, down, level).value) / (2 * h);
        const double value = unit_wv(c.kind, c.shape, level).value;
        EXPECT_NEAR(unit_wv(c.kind, c.shape, level).derivative[k], expected,
                    1e-6 * std::abs(expected) + 1e-8 * value / std::abs(c.shape[k]))
            << short_name(c.kind) << " level " << level << " shape value " << i;
      }
    }
  }
}

}  // namespace
}  // namespace imuscope::noise
