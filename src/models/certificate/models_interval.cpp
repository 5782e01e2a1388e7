#include "models/certificate/models_interval.h"

#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <cmath>

namespace imuscope::certificate {

// T-4
Interval models_interval(std::span<const ModelsValue> models, double confidence) {
  using boost::math::normal;
  const double z = quantile(normal(), 0.5 * (1.0 + confidence));
  const ModelsValue& chosen = models.front();
  Interval interval{chosen.ci_low, chosen.ci_high};
  for (const ModelsValue& model : models.subspan(1)) {
    const double left = 1.0 - std::max(0.0, model.misfit - chosen.misfit) / (z * z);
    if (!(left > 0.0)) continue;
    const double share = std::sqrt(left);
    interval.low = std::min(interval.low, model.value - share * (model.value - model.ci_low));
    interval.high = std::max(interval.high, model.value + share * (model.ci_high - model.value));
  }
  return interval;
}

}  // namespace imuscope::certificate
