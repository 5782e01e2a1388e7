#pragma once

/// The vehicle's own constraints as measurements of the navigation error state: wheels show the forward
/// speed, a vehicle on its wheels moves neither sideways nor upwards, and standing it does not move at all.
/// EQUATIONS.md N-50 to N-55. Core: no allocation.
///
/// Frame v: the vehicle's axes, forward-right-down, at the point that does not slip sideways (the middle of
/// an axle that does not steer).

#include "estimation/navigation/error_model.h"

namespace imuscope {

/// How the vehicle sits relative to the R-IMU, and what its wheels make of a speed.
struct OdometryState {
  Eigen::Matrix3d C_b_v = Eigen::Matrix3d::Identity();  ///< rotates b to v
  Eigen::Vector3d r_bv_b_m = Eigen::Vector3d::Zero();   ///< from b's origin to v's origin, in b
  double scale = 0.0;                                   ///< the wheels show (1 + scale) times the speed
};

/// Order of the odometry error state. The mounting is C_b_v = C^_b_v Exp(-mu), mu in b about y and z: a turn
/// about the direction of travel shows in no speed.
enum OdometryErrorBlock : int {
  kWheelScaleError = 0,
  kVehicleMountError = 1,     ///< mu_y, mu_z, rad
  kVehicleLeverArmError = 3,  ///< dr_bv, b, m
};
inline constexpr int kOdometryErrorSize = 6;
using OdometryErrorVector = Eigen::Matrix<double, kOdometryErrorSize, 1>;

/// innovation = measured - predicted = H * navigation error + H_odometry * odometry error + noise.
/// Rows: what the wheels show, sideways, downwards (measured: 0).
struct OdometryInnovation {
  Eigen::Vector3d innovation;  ///< m/s
  Eigen::Vector3d predicted;   ///< m/s
  NavigationMeasurementMatrix H;
  Eigen::Matrix<double, 3, kOdometryErrorSize> H_odometry;
};

/// @param speed_mps  what the wheels show
/// @param omega_ib_b_measured_radps  the R-IMU's rate at that time, not compensated
[[nodiscard]] OdometryInnovation odometry_innovation(
    const NavigationState& state, const OdometryState& odometry, double speed_mps,
    const Eigen::Vector3d& omega_ib_b_measured_radps) noexcept;

/// Standing: the velocity of b's origin relative to the Earth is zero, in NED.
struct ZeroVelocityInnovation {
  Eigen::Vector3d innovation;
  NavigationMeasurementMatrix H;
};
[[nodiscard]] ZeroVelocityInnovation zero_velocity_innovation(const NavigationState& state) noexcept;

/// Adds an estimated error.
void inject(OdometryState& odometry, const OdometryErrorVector& error) noexcept;

}  // namespace imuscope
