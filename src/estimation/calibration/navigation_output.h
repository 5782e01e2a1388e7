#pragma once

/// The navigation's state and uncertainty as they are shown to people: angles as roll, pitch and heading.

#include <Eigen/Core>
#include <span>

#include "estimation/calibration/estimator.h"
#include "estimation/navigation/navigation_state.h"

namespace imuscope {

/// Writes state and sd into `out`; status, times and NIS are left as they are. Core: no allocation.
///
/// @param sd     of the 15 states, in their order
/// @param P_phi  covariance of the attitude error phi, NED
void write_state(const NavigationState& state, std::span<const double> sd, const Eigen::Matrix3d& P_phi,
                 NavigationOutput& out) noexcept;

}  // namespace imuscope
