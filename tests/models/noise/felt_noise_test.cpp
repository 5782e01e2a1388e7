/// The interval of what is white at a second, where a correlation time of about that makes it no straight function of
/// the parameters: against all models that the data allow, drawn at random.

#include "models/noise/felt_noise.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <ostream>
#include <random>

#include "models/noise/parameter_scale.h"
#include "models/noise/simulated_noise.h"
#include "models/noise/wv_covariance.h"

namespace imuscope::noise {
namespace {

constexpr double kRate_hz = 100.0;
constexpr std::size_t kFeltSamples = 1U << 17U;

struct TimeCase {
  double tau_s;
  unsigned seed;
};

void PrintTo(const TimeCase& c, std::ostream* out) { *out << c.tau_s << " s"; }

/// WN + GM in logarithms of their parameters.
using Theta = Eigen::Vector3d;

Theta theta_of(const Model& model) {
  Theta theta = Theta::Zero();
  for (const Component& c : model.components) {
    const bool is_gm = c.kind == ProcessKind::kGaussMarkov;
    theta[is_gm ? 1 : 0] = std::log(c.amplitude);
    if (is_gm) theta[2] = std::log(c.shape[0]);
  }
  return theta;
}

Model model_of(const Theta& theta) {
  return {{{ProcessKind::kWhiteNoise, std::exp(theta[0]), {}},
           {ProcessKind::kGaussMarkov, std::exp(theta[1]), {std::exp(theta[2]), 0.0}}}};
}

/// Covariance of the fit's parameters: the levels' covariance through central differences.
Eigen::Matrix3d covariance_of(const FitResult& fit, const WaveletVariance& wv) {
  const auto n = static_cast<Eigen::Index>(fit.wv.size());
  Eigen::MatrixXd a(n, 3);
  constexpr double kStep = 1e-5;
  for (Eigen::Index k = 0; k < 3; ++k) {
    Theta step = Theta::Zero();
    step[k] = kStep;
    const Theta theta = theta_of(fit.model);
    for (Eigen::Index i = 0; i < n; ++i) {
      const int level = fit.wv[static_cast<std::size_t>(i)].observed.level;
      a(i, k) =
          (model_wv(model_of(theta + step), level) - model_wv(model_of(theta - step), level)) / (2.0 * kStep);
    }
  }
  const Eigen::MatrixXd v = wv_covariance(fit.model, wv, fit.wv.size());
  return (a.transpose() * v.ldlt().solve(a)).inverse();
}

class WhiteAboutASecond : public testing::TestWithParam<TimeCase> {};

TEST_P(WhiteAboutASecond, HasTheIntervalOfAllModelsThatTheDataAllow) {
  const Model truth{{{ProcessKind::kWhiteNoise, 0.04, {}},
                     {ProcessKind::kGaussMarkov, 1e-4, {1.0 / (GetParam().tau_s * kRate_hz), 0.0}}}};
  std::mt19937_64 random(GetParam().seed);
  const auto wv = haar_wavelet_variance(simulated_noise(truth, kFeltSamples, random)).value();
  const FitResult fitted = fit(wv, parse_model("WN+GM").value(), kRate_hz).value();
  ASSERT_EQ(fitted.model_error, 0.0);
  const Felt felt = felt_white_density(fitted, {});
  ASSERT_EQ(felt.knowledge, Knowledge::kFitted);

  const double z = 1.959963984540054;
  const Eigen::Matrix3d root = covariance_of(fitted, wv).llt().matrixL();
  std::normal_distribution<double> normal;
  std::array<double, 2> most{std::numeric_limits<double>::infinity(), 0.0};
  constexpr int kDraws = 100'000;
  for (int i = 0; i < kDraws; ++i) {
    const Theta direction = Theta(normal(random), normal(random), normal(random)).normalized();
    const double radius = z * std::cbrt(std::uniform_real_distribution<double>()(random));
    const double white =
        white_density(model_of(theta_of(fitted.model) + root * (radius * direction)), kRate_hz, {});
    most = {std::min(most[0], white), std::max(most[1], white)};
  }
  const double width = std::log(most[1] / most[0]);
  EXPECT_NEAR(std::log(felt.lower / most[0]), 0.0, 0.08 * width);
  EXPECT_NEAR(std::log(felt.upper / most[1]), 0.0, 0.08 * width);
  EXPECT_LE(felt.lower, felt.value);
  EXPECT_GE(felt.upper, felt.value);
}

INSTANTIATE_TEST_SUITE_P(CorrelationTimes, WhiteAboutASecond,
                         testing::Values(TimeCase{0.3, 1}, TimeCase{0.6, 2}, TimeCase{1.0, 3},
                                         TimeCase{1.5, 4}, TimeCase{2.5, 5}, TimeCase{20.0, 6}));

}  // namespace
}  // namespace imuscope::noise
