#include "models/noise/conservative.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "models/noise/inference.h"
#include "models/noise/parameter_scale.h"

namespace imuscope::noise {
namespace {

/// Row j: what each component contributes at level j, as share of what the level has to reach.
Eigen::MatrixXd contributions(const FitResult& fit) {
  std::vector<const FittedLevel*> used;
  for (const FittedLevel& level : fit.wv) {
    if (level.model_ci_high > 0.0 && has_enough_coefficients(level.observed, fit.efficiency))
      used.push_back(&level);
  }
  const auto& components = fit.model.components;
  Eigen::MatrixXd g(static_cast<Eigen::Index>(used.size()), static_cast<Eigen::Index>(components.size()));
  for (Eigen::Index j = 0; j < g.rows(); ++j) {
    const FittedLevel& level = *used[static_cast<std::size_t>(j)];
    for (Eigen::Index i = 0; i < g.cols(); ++i) {
      const Component& c = components[static_cast<std::size_t>(i)];
      g(j, i) = c.amplitude * unit_wv(c.kind, c.shape, level.observed.level).value / level.model_ci_high;
    }
  }
  return g;
}

/// G-19: argmin |u - 1|^2 with g u >= 1, g >= 0, by ascent in the dual, one row at a time (Hildreth 1957).
Eigen::VectorXd smallest_factors(const Eigen::MatrixXd& g) {
  constexpr int kMaxRounds = 10'000;
  constexpr double kReached = 1e-10;
  Eigen::VectorXd u = Eigen::VectorXd::Ones(g.cols());
  Eigen::VectorXd multiplier = Eigen::VectorXd::Zero(g.rows());
  for (int round = 0; round < kMaxRounds; ++round) {
    double moved = 0.0;
    for (Eigen::Index j = 0; j < g.rows(); ++j) {
      const double length = g.row(j).squaredNorm();
      if (length <= 0.0) continue;
      const double next = std::max(0.0, multiplier[j] + (1.0 - g.row(j).dot(u)) / length);
      const double step = next - multiplier[j];
      multiplier[j] = next;
      u += step * g.row(j).transpose();
      moved = std::max(moved, std::abs(step) * length);
    }
    if (moved < kReached) break;
  }
  // What the ascent left open is closed by one common factor.
  const double least = g.rows() > 0 ? (g * u).minCoeff() : 1.0;
  return least < 1.0 && least > 0.0 ? Eigen::VectorXd(u / least) : u;
}

}  // namespace

FitResult over_bounding(const FitResult& fit) {
  const Eigen::VectorXd factor = smallest_factors(contributions(fit));
  FitResult out = fit;
  const auto places = parameter_places(fit.model);
  for (std::size_t p = 0; p < places.size(); ++p) {
    ParameterEstimate& parameter = out.parameters[p];
    parameter.sd = parameter.ci_low = parameter.ci_high = parameter.log_sd = std::nullopt;
    if (places[p].shape >= 0) continue;
    const double f = factor[static_cast<Eigen::Index>(places[p].component)];
    parameter.value *= parameter_scale_of(parameter.name) == ParameterScale::kLogSquare ? std::sqrt(f) : f;
  }
  for (std::size_t i = 0; i < out.model.components.size(); ++i) {
    out.model.components[i].amplitude *= factor[static_cast<Eigen::Index>(i)];
  }
  for (FittedLevel& level : out.wv) level.fitted = model_wv(out.model, level.observed.level);
  out.covariance.assign(out.covariance.size(), std::nan(""));
  return out;
}

double largest_increase(const FitResult& fit, const FitResult& bound) {
  double largest = 1.0;
  for (std::size_t i = 0; i < fit.model.components.size(); ++i) {
    const double own = fit.model.components[i].amplitude;
    if (own > 0.0) largest = std::max(largest, bound.model.components[i].amplitude / own);
  }
  return largest;
}

}  // namespace imuscope::noise
