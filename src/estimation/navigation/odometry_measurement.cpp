#include "estimation/navigation/odometry_measurement.h"

#include "estimation/navigation/local_earth.h"
#include "estimation/navigation/so3.h"

namespace imuscope {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// N-50 to N-53
OdometryInnovation odometry_innovation(const NavigationState& state, const OdometryState& odometry,
                                       double speed_mps, const Vector3d& omega_ib_b_measured_radps) noexcept {
  const LocalEarth earth(state.position);
  const Matrix3d C_n_b = state.C_b_n.transpose();
  const Vector3d& arm = odometry.r_bv_b_m;
  const Vector3d omega_eb_b = omega_ib_b_measured_radps - state.gyro_bias_b_radps - C_n_b * earth.w_ie;
  // N-50: the velocity where the axle is, then in v
  const Vector3d v_b = C_n_b * state.v_n_mps + omega_eb_b.cross(arm);
  const Matrix3d& C = odometry.C_b_v;
  const Vector3d v_v = C * v_b;
  const Matrix3d arm_x = skew(arm);

  OdometryInnovation out;
  out.H.setZero();
  // N-52: by the navigation's errors
  const Vector3d w_ie_by_north(-kEarthRate_radps * earth.sin_L / earth.M, 0.0,
                               -kEarthRate_radps * earth.cos_L / earth.M);
  out.H.col(kPositionError) = C * arm_x * C_n_b * w_ie_by_north;
  out.H.middleCols<3>(kVelocityError) = C * C_n_b;
  out.H.middleCols<3>(kAttitudeError) = C * (C_n_b * skew(state.v_n_mps) + arm_x * C_n_b * skew(earth.w_ie));
  out.H.middleCols<3>(kGyroBiasError) = C * arm_x;

  // N-51: by mounting and lever arm
  const Matrix3d by_mount = C * skew(v_b);
  out.H_odometry.setZero();
  out.H_odometry.middleCols<2>(kVehicleMountError) = by_mount.rightCols<2>();
  out.H_odometry.middleCols<3>(kVehicleLeverArmError) = C * skew(omega_eb_b);

  // N-53: what the wheels show
  const double wheel = 1.0 + odometry.scale;
  out.H.row(0) *= wheel;
  out.H_odometry.row(0) *= wheel;
  out.H_odometry(0, kWheelScaleError) = v_v.x();
  out.predicted = Vector3d(wheel * v_v.x(), v_v.y(), v_v.z());
  out.innovation = Vector3d(speed_mps, 0.0, 0.0) - out.predicted;
  return out;
}

// N-54
ZeroVelocityInnovation zero_velocity_innovation(const NavigationState& state) noexcept {
  ZeroVelocityInnovation out;
  out.innovation = -state.v_n_mps;
  out.H.setZero();
  out.H.middleCols<3>(kVelocityError).setIdentity();
  return out;
}

// N-55
void inject(OdometryState& odometry, const OdometryErrorVector& error) noexcept {
  const Vector3d mu(0.0, error(kVehicleMountError), error(kVehicleMountError + 1));
  odometry.C_b_v = reorthonormalized(odometry.C_b_v * exp_so3(-mu));
  odometry.r_bv_b_m += error.segment<3>(kVehicleLeverArmError);
  odometry.scale += error(kWheelScaleError);
}

}  // namespace imuscope
