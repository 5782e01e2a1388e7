#include "models/certificate/models_interval.h"

#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <cmath>

namespace imuscope::certificate {
namespace {

/// What one parameter too many takes off the misfit in the mean: models this near to each other are as likely.
constexpr double kAsLikely = 1.0;

}  // namespace

// T-4
Interval models_interval(std::span<const ModelsValue> models, double confidence) {
  using boost::math::normal;
  const double z = quantile(normal(), 0.5 * (1.0 + confidence));
  const double least = std::ranges::min(models, {}, &ModelsValue::misfit).misfit;
  Interval interval{models.front().value, models.front().value};
  for (const ModelsValue& model : models) {
    const double left = 1.0 - std::max(0.0, model.misfit - least - kAsLikely) / (z * z);
    if (!(left > 0.0)) continue;
    const double share = std::sqrt(left);
    interval.low = std::min(interval.low, model.value - share * (model.value - model.ci_low));
    interval.high = std::max(interval.high, model.value + share * (model.ci_high - model.value));
  }
  return interval;
}

}  // namespace imuscope::certificate
