#include "models/noise/state_space.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "models/noise/power_law.h"
#include "models/noise/wavelet_variance.h"

namespace imuscope::noise {
namespace {

/// E[W_j^2] of the Haar wavelet over 2^level consecutive outputs, from the form alone: the coefficient is
/// linear in (x_0, w, v), so its variance follows from propagating covariances, without process.cpp's curves.
double wv_of_form(const StateSpace& form, int level) {
  const int tau = 1 << level;
  const int n = tau / 2;
  const Eigen::Index m = form.F.rows();
  // Covariance matrix of tau consecutive outputs.
  Eigen::MatrixXd S(tau, tau);
  Eigen::MatrixXd P = form.P0;
  for (int i = 0; i < tau; ++i) {
    Eigen::MatrixXd cross = P;
    for (int j = i; j < tau; ++j) {
      S(i, j) = S(j, i) = m > 0 ? (form.H * cross * form.H.transpose())(0, 0) : 0.0;
      if (i == j) S(i, j) += form.R;
      cross = (form.F * cross).eval();
    }
    P = (form.F * P * form.F.transpose() + form.Q).eval();
  }
  Eigen::VectorXd h(tau);
  for (int i = 0; i < tau; ++i) h(i) = (i < n ? -1.0 : 1.0) / (2.0 * n);
  return h.dot(S * h);
}

Model of(ProcessKind kind, double amplitude, Shape shape = {}) { return {{{kind, amplitude, shape}}}; }

TEST(StateSpace, EveryProcessHasTheWaveletVarianceOfItsCurve) {
  const std::vector<Model> models{
      of(ProcessKind::kWhiteNoise, 0.7),
      of(ProcessKind::kQuantization, 0.3),
      of(ProcessKind::kMa1, 0.5, {0.6, 0.0}),
      of(ProcessKind::kArma11, 0.5, {0.8, -0.3}),
      of(ProcessKind::kSinusoid, 2.0, {0.37, 0.0}),
      of(ProcessKind::kGaussMarkov, 1.5, {0.02, 0.0}),
      of(ProcessKind::kResonance, 0.8, {0.05, 0.9}),
      of(ProcessKind::kRandomWalk, 0.01),
      of(ProcessKind::kRamp, 1e-4),
  };
  for (const Model& model : models) {
    const StateSpace form = state_space(model);
    for (const int level : {1, 2, 3, 5, 7}) {
      const double expected = model_wv(model, level);
      EXPECT_NEAR(wv_of_form(form, level), expected, 1e-9 * expected)
          << short_name(model.components.front().kind) << " level " << level;
    }
  }
}

// Flicker and power laws are approximated: power_law.h says how well.
TEST(StateSpace, APowerLawIsTheSumThatStandsForIt) {
  for (const Model& model : {of(ProcessKind::kFlicker, 1.3), of(ProcessKind::kPowerLaw, 0.2, {0.6, 0.0})}) {
    const StateSpace form = state_space(model);
    for (const int level : {1, 2, 3, 5, 7}) {
      const double expected = model_wv(model, level);
      EXPECT_NEAR(wv_of_form(form, level), expected, kPowerLawSumError * expected) << level;
    }
  }
}

TEST(StateSpace, ComponentsStandBesideEachOther) {
  Model model = of(ProcessKind::kWhiteNoise, 1.0);
  model.components.push_back({ProcessKind::kGaussMarkov, 0.5, {0.1, 0.0}});
  model.components.push_back({ProcessKind::kGaussMarkov, 0.0, {0.001, 0.0}});
  model.components.push_back({ProcessKind::kRandomWalk, 1e-4, {}});
  const StateSpace form = state_space(model);
  EXPECT_EQ(form.F.rows(), 2);  // an amplitude of zero has no state
  EXPECT_DOUBLE_EQ(form.R, 1.0);
  EXPECT_EQ(form.diffuse, (std::vector<bool>{false, true}));
  EXPECT_NEAR(wv_of_form(form, 6), model_wv(model, 6), 1e-12);
}

}  // namespace
}  // namespace imuscope::noise
