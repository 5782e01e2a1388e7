#pragma once

/// Names of the filter's states, for messages to people. Non-real-time: allocates.

#include <cstddef>
#include <optional>
#include <string>

#include "estimation/calibration/estimator_config.h"

namespace imuscope {

struct StateName {
  std::optional<std::size_t> study;  ///< whose state; none: the navigation's
  std::string name;                  ///< such as "accel_bias_y"
};

/// Name of state `index` in the filter's error state (E-1). Past the S-IMUs: "state N".
[[nodiscard]] StateName state_name(const EstimatorConfig& config, std::size_t index);

}  // namespace imuscope
