#pragma once

/// GNSS position and velocity at the antenna, as measurements of the navigation error state.
/// EQUATIONS.md N-30 to N-33. Core: no allocation.

#include "estimation/navigation/error_model.h"

namespace imuscope {

/// innovation = measured - predicted = H * error + noise.
struct GnssInnovation {
  Eigen::Vector3d innovation;  ///< NED, m or m/s
  NavigationMeasurementMatrix H;
};

/// @param antenna      measured position of the antenna
/// @param r_ba_b_m     antenna's lever arm: from b's origin to the antenna's phase centre, in b
[[nodiscard]] GnssInnovation gnss_position_innovation(const NavigationState& state,
                                                      const GeodeticPosition& antenna,
                                                      const Eigen::Vector3d& r_ba_b_m) noexcept;

/// @param v_antenna_n_mps  measured velocity of the antenna relative to the Earth, NED
/// @param omega_ib_b_measured_radps  the R-IMU's rate at the measurement's time, not compensated: its bias is
///                         in the state and enters H
[[nodiscard]] GnssInnovation gnss_velocity_innovation(const NavigationState& state,
                                                      const Eigen::Vector3d& v_antenna_n_mps,
                                                      const Eigen::Vector3d& omega_ib_b_measured_radps,
                                                      const Eigen::Vector3d& r_ba_b_m) noexcept;

}  // namespace imuscope
