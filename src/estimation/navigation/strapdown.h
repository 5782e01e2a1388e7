#pragma once

/// Strapdown mechanisation in local NED: attitude, velocity and position of the R-IMU carried over one sample
/// interval. EQUATIONS.md N-10 to N-16. Core: no allocation, noexcept.

#include "estimation/navigation/navigation_state.h"

namespace imuscope {

/// The motion of b during one interval, as integrals of the compensated rates, resolved in b at its start.
struct InertialIncrement {
  Eigen::Vector3d rotation_rad = Eigen::Vector3d::Zero();   ///< rotation vector of b, coning included
  Eigen::Vector3d delta_v_b_mps = Eigen::Vector3d::Zero();  ///< integral of f, rotation and sculling included
  double dt_s = 0.0;
};

/// From instantaneous samples at both ends of the interval (rate and force taken as linear in between).
/// @param start, end  compensated
[[nodiscard]] InertialIncrement increment_from_samples(const InertialRates& start, const InertialRates& end,
                                                       double dt_s) noexcept;

/// From means over the interval (a device that sends increments / dt), with the means of the interval before
/// for the two-sample coning and sculling terms. Both intervals last dt_s. Without an interval before, hand
/// in `mean` twice.
/// @param previous_mean, mean  compensated
[[nodiscard]] InertialIncrement increment_from_means(const InertialRates& previous_mean,
                                                     const InertialRates& mean, double dt_s) noexcept;

/// Carries the state over one interval. Gravity, Earth and transport rate are those of the interval's middle.
void propagate(NavigationState& state, const InertialIncrement& increment) noexcept;

}  // namespace imuscope
