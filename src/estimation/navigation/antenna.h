#pragma once

/// What is not known of antenna and receiver, as states of the filter: where the antenna is, and how much
/// later than the R-IMU's time a solution is stamped. EQUATIONS.md N-34 to N-37. Core: no allocation.

#include "estimation/navigation/error_model.h"

namespace imuscope {

struct AntennaState {
  Eigen::Vector3d r_ba_b_m =
      Eigen::Vector3d::Zero();  ///< from b's origin to the antenna's phase centre, in b
  double latency_s = 0.0;       ///< a solution stamped at t shows the motion of the R sample of t - latency
};

/// Order of the antenna's error state.
enum AntennaErrorBlock : int {
  kAntennaLeverArmError = 0,  ///< dl, b, m
  kReceiverLatencyError = 3,  ///< s
};
inline constexpr int kAntennaErrorSize = 4;
using AntennaErrorVector = Eigen::Matrix<double, kAntennaErrorSize, 1>;
/// Columns of a GNSS measurement's H that belong to the antenna.
using AntennaMatrix = Eigen::Matrix<double, 3, kAntennaErrorSize>;

/// Of gnss_position_innovation() and gnss_velocity_innovation(), with the arm that they were given.
/// @param measured  the R-IMU at the measurement's time, not compensated
[[nodiscard]] AntennaMatrix antenna_in_position(const NavigationState& state, const InertialRates& measured,
                                                const Eigen::Vector3d& r_ba_b_m) noexcept;
[[nodiscard]] AntennaMatrix antenna_in_velocity(const NavigationState& state, const InertialRates& measured,
                                                const Eigen::Vector3d& r_ba_b_m) noexcept;

/// Adds an estimated error.
void inject(AntennaState& antenna, const AntennaErrorVector& error) noexcept;

}  // namespace imuscope
