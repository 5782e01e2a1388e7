#include "estimation/navigation/gnss_measurement.h"

#include "estimation/navigation/local_earth.h"
#include "estimation/navigation/so3.h"

namespace imuscope {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// d(theta)/d(dr): how local NED turns, relative to the Earth, per metre of travel. A vector with constant
/// components in local NED moves by theta x vector relative to NED of the estimate (N-31).
Matrix3d frame_turn_by_position(const LocalEarth& earth) noexcept {
  Matrix3d D = Matrix3d::Zero();
  D(0, 1) = 1.0 / earth.N;
  D(1, 0) = -1.0 / earth.M;
  D(2, 1) = -earth.tan_L / earth.N;
  return D;
}

}  // namespace

// N-30, N-31
GnssInnovation gnss_position_innovation(const NavigationState& state, const GeodeticPosition& antenna,
                                        const Vector3d& r_ba_b_m) noexcept {
  const Vector3d arm_n = state.C_b_n * r_ba_b_m;
  GnssInnovation out;
  out.innovation = ned_offset(state.position, antenna) - arm_n;
  out.H.setZero();
  out.H.middleCols<3>(kPositionError) =
      Matrix3d::Identity() - skew(arm_n) * frame_turn_by_position(LocalEarth(state.position));
  out.H.middleCols<3>(kAttitudeError) = -skew(arm_n);
  return out;
}

// N-32, N-33: the antenna's velocity relative to the Earth is v + w_eb x l.
GnssInnovation gnss_velocity_innovation(const NavigationState& state, const Vector3d& v_antenna_n_mps,
                                        const Vector3d& omega_ib_b_measured_radps,
                                        const Vector3d& r_ba_b_m) noexcept {
  const Vector3d omega_ib_b = omega_ib_b_measured_radps - state.gyro_bias_b_radps;
  const Vector3d arm_n = state.C_b_n * r_ba_b_m;
  const LocalEarth earth(state.position);
  const Vector3d swing_n = state.C_b_n * omega_ib_b.cross(r_ba_b_m);
  GnssInnovation out;
  out.innovation = v_antenna_n_mps - (state.v_n_mps + swing_n - earth.w_ie.cross(arm_n));
  out.H.setZero();
  // Earth rate's change with latitude acts through the arm: skew(arm) d(w_ie)/d(dr_N).
  const Vector3d w_ie_by_north(-kEarthRate_radps * earth.sin_L / earth.M, 0.0,
                               -kEarthRate_radps * earth.cos_L / earth.M);
  out.H.col(kPositionError) = arm_n.cross(w_ie_by_north);
  out.H.middleCols<3>(kVelocityError).setIdentity();
  out.H.middleCols<3>(kAttitudeError) = -skew(swing_n) + skew(earth.w_ie) * skew(arm_n);
  out.H.middleCols<3>(kGyroBiasError) = state.C_b_n * skew(r_ba_b_m);
  return out;
}

}  // namespace imuscope
