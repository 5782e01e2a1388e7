#pragma once

/// The vehicle's speed as regimes are told by it: from navigation, or from the odometry where nothing
/// navigates.

#include <optional>
#include <type_traits>

#include "estimation/calibration/estimator.h"

namespace imuscope {

struct VehicleSpeed {
  HostTime time;  ///< of validity
  double speed_mps;
  double sd_mps;
};
static_assert(std::is_trivially_copyable_v<std::optional<VehicleSpeed>>);

/// Absent where no speed is known. Thread: any. Allocates: never.
std::optional<VehicleSpeed> vehicle_speed(const NavigationOutput& navigation, const OdometryOutput& odometry,
                                          const EstimatorCounters& counters) noexcept;

}  // namespace imuscope
