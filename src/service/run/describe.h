#pragma once

/// Events in words.

#include <string>

#include "configuration/config.h"
#include "estimation/calibration/estimator.h"

namespace imuscope {

/// What a person should know of an event, in one sentence.
std::string describe(const Configuration& configuration, const EstimatorEvent& event);

}  // namespace imuscope
