#include "models/noise/process.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <vector>

#include "made_series.h"
#include "models/noise/model.h"
#include "models/noise/power_law.h"
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

// Squares of one exponential instead of one a level: from the slowest process to the fastest, and across the
// end of the series.
TEST(Process, ACurveOfAllLevelsIsThatOfEachLevelByItself) {
  std::vector<CurvePoint> curve(kMaxLevel);
  const auto agree = [&](ProcessKind kind, const Shape& shape) {
    unit_curve(kind, shape, curve);
    for (int level = 1; level <= kMaxLevel; ++level) {
      const CurvePoint& all = curve[static_cast<std::size_t>(level - 1)];
      const CurvePoint one = unit_wv(kind, shape, level);
      EXPECT_LT(relative(all.value, one.value), 1e-12) << shape[0] << ' ' << shape[1] << " level " << level;
      for (std::size_t i = 0; i < 2; ++i) {
        // It passes zero, where it is to be small beside the curve.
        const double slope = one.derivative[i] * shape[i];
        EXPECT_NEAR(all.derivative[i] * shape[i], slope, 1e-12 * (std::abs(one.value) + std::abs(slope)))
            << shape[0] << ' ' << shape[1] << " level " << level;
      }
    }
  };
  for (double a = 1e-9; a < 20.0; a *= 1.7) agree(ProcessKind::kGaussMarkov, {a, 0.0});
  for (double a = 1e-3; a < 1.5; a *= 2.3) {
    for (double b = 0.01; b < 3.1; b *= 1.9) agree(ProcessKind::kResonance, {a, b});
  }
  agree(ProcessKind::kSinusoid, {0.3, 0.0});
  agree(ProcessKind::kFlicker, {});
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

TEST(Process, AResonanceHasTheCurveOfItsAutocovariance) {
  constexpr std::size_t kLongest = 1024;
  for (const auto& [a, b] : {std::pair{0.05, 1.2}, {0.3, 0.4}, {1e-3, 0.02}, {1.5, 3.0}, {0.01, 0.003}}) {
    std::vector<double> g(kLongest + 1);
    for (std::size_t i = 0; i < g.size(); ++i) {
      const auto k = static_cast<double>(i);
      g[i] = std::exp(-a * k) * (std::cos(b * k) + a / b * std::sin(b * k));
    }
    for (int level = 1; level <= 10; ++level) {
      const std::size_t n = std::size_t{1} << static_cast<unsigned>(level - 1);
      const double expected = from_autocovariance(g, n);
      EXPECT_NEAR(resonance_wv(a, b, level).value, expected, 1e-9 * expected + 1e-13)
          << a << ' ' << b << ' ' << level;
    }
  }
}

/// Integral of |transfer function|^2 |2 sin(pi f)|^-alpha over -1/2 < f < 1/2 by the trapezoidal rule in u, f
/// = u^3 / 2, which has no singularity left.
double power_law_by_spectrum(double alpha, double n) {
  constexpr int kSteps = 400'000;
  double sum = 0.0;
  for (int i = 1; i <= kSteps; ++i) {
    const double u = static_cast<double>(i) / kSteps;
    const double f = 0.5 * u * u * u;
    const double s = std::sin(M_PI * f);
    const double sn = std::sin(M_PI * f * n);
    const double gain = sn * sn * sn * sn / (n * n * s * s);
    sum += (i == kSteps ? 0.5 : 1.0) * gain * std::pow(2.0 * s, -alpha) * 1.5 * u * u / kSteps;
  }
  return 2.0 * sum;
}

TEST(Process, PowerLawsHaveTheWaveletVarianceOfTheirSpectrum) {
  for (const double alpha : {0.2, 0.7, 0.999999, 1.0, 1.0001, 1.4, 1.8}) {
    for (const int level : {1, 2, 5, 8, 12}) {
      const double expected = power_law_by_spectrum(alpha, std::ldexp(1.0, level - 1));
      EXPECT_LT(relative(power_law_wv(alpha, level).value, expected), 2e-6) << alpha << " level " << level;
    }
  }
}

TEST(Process, PowerLawsEndInWhiteNoiseAndInARandomWalk) {
  for (int level = 1; level <= 24; ++level) {
    EXPECT_LT(relative(power_law_wv(1e-9, level).value, unit_wv(ProcessKind::kWhiteNoise, {}, level).value),
              1e-6);
    EXPECT_LT(
        relative(power_law_wv(2.0 - 1e-9, level).value, unit_wv(ProcessKind::kRandomWalk, {}, level).value),
        1e-6);
  }
}

// IEEE Std 952-2020, annex C: the Allan variance of flicker noise is 2 ln 2 / pi B^2, and twice the wavelet
// variance.
TEST(Process, FlickerNoiseIsFlatAtTheBiasInstability) {
  for (int level = 12; level <= 28; ++level) {
    EXPECT_LT(relative(2.0 * unit_wv(ProcessKind::kFlicker, {}, level).value, 2.0 * std::log(2.0) / M_PI),
              1e-6)
        << level;
  }
}

TEST(Process, ASumOfGaussMarkovProcessesFollowsAPowerLaw) {
  for (const double alpha : {0.3, 0.6, 1.0, 1.3, 1.7}) {
    const Component law{ProcessKind::kPowerLaw, 2.0, {alpha, 0.0}};
    const Model sum{power_law_sum(law)};
    for (int level = 1; level <= 24; ++level) {
      EXPECT_LT(relative(model_wv(sum, level), 2.0 * power_law_wv(alpha, level).value), kPowerLawSumError)
          << alpha << " level " << level;
    }
  }
}

TEST(Process, DerivativesMatchCentralDifferences) {
  struct Case {
    ProcessKind kind;
    Shape shape;
  };
  const std::vector<Case> cases{
      {ProcessKind::kMa1, {0.4, 0}},         {ProcessKind::kMa1, {-0.8, 0}},
      {ProcessKind::kSinusoid, {0.37, 0}},   {ProcessKind::kSinusoid, {0.011, 0}},
      {ProcessKind::kArma11, {0.3, 0.2}},    {ProcessKind::kArma11, {-0.6, 0.7}},
      {ProcessKind::kArma11, {0.95, -0.5}},  {ProcessKind::kGaussMarkov, {0.02, 0}},
      {ProcessKind::kResonance, {0.1, 0.9}}, {ProcessKind::kResonance, {0.02, 0.01}},
      {ProcessKind::kPowerLaw, {0.6, 0}},    {ProcessKind::kPowerLaw, {1.0, 0}},
      {ProcessKind::kPowerLaw, {1.5, 0}}};
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
