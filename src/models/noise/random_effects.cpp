#include "models/noise/random_effects.h"

#include <algorithm>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>

#include "base/contracts.h"
#include "models/noise/chi_squared.h"
#include "models/noise/spread_solver.h"

namespace imuscope::noise {
namespace {

/// Units weighted by one value of the variance between them.
struct Weighted {
  double mean = 0.0;
  double weight = 0.0;  ///< sum over the units
  double q = 0.0;       ///< weighted sum of squares about the mean
};

Weighted weighted_by(std::span<const double> values, std::span<const double> variances, double between) {
  Weighted out;
  for (std::size_t k = 0; k < values.size(); ++k) {
    const double weight = 1.0 / (variances[k] + between);
    out.weight += weight;
    out.mean += weight * values[k];
  }
  out.mean /= out.weight;
  for (std::size_t k = 0; k < values.size(); ++k) {
    const double d = values[k] - out.mean;
    out.q += d * d / (variances[k] + between);
  }
  return out;
}

/// The variance between units at which the weighted sum of squares is `q`.
double between_at(std::span<const double> values, std::span<const double> variances, double q) {
  return variance_at([&](double between) { return weighted_by(values, variances, between).q; }, q,
                     *std::max_element(variances.begin(), variances.end()));
}

}  // namespace

// G-17: tau, the mean and their intervals
std::optional<RandomEffects> random_effects(std::span<const double> values, std::span<const double> variances,
                                            double confidence) {
  IMUSCOPE_EXPECTS(values.size() == variances.size());
  if (values.size() < 2) return std::nullopt;
  for (std::size_t k = 0; k < values.size(); ++k) {
    if (!(variances[k] > 0.0) || !std::isfinite(variances[k]) || !std::isfinite(values[k]))
      return std::nullopt;
  }
  const auto dof = static_cast<double>(values.size() - 1);
  const double tail = 0.5 * (1.0 - confidence);
  const double between = between_at(values, variances, dof);
  const Weighted at = weighted_by(values, variances, between);
  RandomEffects out;
  out.mean = at.mean;
  out.sd = std::sqrt(at.q / dof / at.weight);
  const double half = boost::math::quantile(boost::math::students_t(dof), 1.0 - tail) * out.sd;
  out.ci_low = out.mean - half;
  out.ci_high = out.mean + half;
  out.spread = std::sqrt(between);
  out.spread_low = std::sqrt(between_at(values, variances, chi_squared_quantile(dof, 1.0 - tail)));
  out.spread_high = std::sqrt(between_at(values, variances, chi_squared_quantile(dof, tail)));
  return out;
}

}  // namespace imuscope::noise
