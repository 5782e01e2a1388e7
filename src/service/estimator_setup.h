#pragma once

/// From the configuration to the estimator's own terms.

#include "calibration/estimator_config.h"
#include "service/config.h"

namespace imuscope {

/// Studies come in the order of the configuration. What the configuration leaves out keeps the estimator's
/// default.
EstimatorConfig estimator_config(const Configuration& configuration);

}  // namespace imuscope
