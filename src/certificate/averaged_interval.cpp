#include "certificate/averaged_interval.h"

#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/tools/toms748_solve.hpp>
#include <cmath>
#include <vector>

namespace imuscope::certificate {
namespace {

using boost::math::normal;

std::vector<double> beliefs(std::span<const ModelsValue> models) {
  const double best = std::min_element(models.begin(), models.end(), [](const auto& a, const auto& b) {
                        return a.criterion < b.criterion;
                      })->criterion;
  std::vector<double> weights;
  double sum = 0.0;
  for (const ModelsValue& model : models) {
    weights.push_back(std::exp(-0.5 * (model.criterion - best)));
    sum += weights.back();
  }
  for (double& weight : weights) weight /= sum;
  return weights;
}

/// Share of the model's belief below x: a normal distribution on either side of its value.
double below(const ModelsValue& model, double x, double z) {
  const double half = x < model.value ? model.value - model.ci_low : model.ci_high - model.value;
  if (!(half > 0.0)) return x < model.value ? 0.0 : 1.0;
  return cdf(normal(), z * (x - model.value) / half);
}

}  // namespace

Interval averaged_interval(std::span<const ModelsValue> models, double confidence) {
  Interval all{models.front().ci_low, models.front().ci_high};
  for (const ModelsValue& model : models)
    all = {std::min(all.low, model.ci_low), std::max(all.high, model.ci_high)};
  if (models.size() == 1) return all;
  const std::vector<double> weights = beliefs(models);
  const double tail = 0.5 * (1.0 - confidence);
  const double z = quantile(normal(), 1.0 - tail);
  // Every model's own tail ends within `all`, so that their mean has its end there, too.
  const auto end = [&](double share) {
    const auto excess = [&](double x) {
      double sum = -share;
      for (std::size_t i = 0; i < models.size(); ++i) sum += weights[i] * below(models[i], x, z);
      return sum;
    };
    if (excess(all.low) >= 0.0) return all.low;
    if (excess(all.high) <= 0.0) return all.high;
    std::uintmax_t steps = 100;
    const boost::math::tools::eps_tolerance<double> tolerance(30);
    const auto bracket = boost::math::tools::toms748_solve(excess, all.low, all.high, tolerance, steps);
    return 0.5 * (bracket.first + bracket.second);
  };
  const double value = models.front().value;
  return {std::min(end(tail), value), std::max(end(1.0 - tail), value)};
}

}  // namespace imuscope::certificate
