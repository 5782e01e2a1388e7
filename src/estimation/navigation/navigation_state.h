#pragma once

/// Where the R-IMU is, how it moves and how it sits, with the biases of its sensors.

#include <Eigen/Core>

#include "estimation/navigation/wgs84.h"

namespace imuscope {

/// The R-IMU's rate and force, raw or compensated as the use says.
struct InertialRates {
  Eigen::Vector3d omega_ib_b_radps = Eigen::Vector3d::Zero();
  Eigen::Vector3d f_b_mps2 = Eigen::Vector3d::Zero();
};

/// The origin and axes are those of the R-IMU (frame b, forward-right-down).
/// Compensated rates are measured minus bias: omega_ib_b = omega_measured - gyro_bias_b.
struct NavigationState {
  GeodeticPosition position;
  Eigen::Vector3d v_n_mps = Eigen::Vector3d::Zero();    ///< relative to the Earth, in NED
  Eigen::Matrix3d C_b_n = Eigen::Matrix3d::Identity();  ///< rotates b to NED
  Eigen::Vector3d gyro_bias_b_radps = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel_bias_b_mps2 = Eigen::Vector3d::Zero();
};

/// Measured rates minus the state's biases.
inline InertialRates compensated(const InertialRates& measured, const NavigationState& state) noexcept {
  return {measured.omega_ib_b_radps - state.gyro_bias_b_radps, measured.f_b_mps2 - state.accel_bias_b_mps2};
}

}  // namespace imuscope
