#include "estimation/calibration/navigation_output.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "estimation/calibration/filter_core.h"
#include "estimation/navigation/so3.h"

namespace imuscope {

void write_state(const NavigationState& state, std::span<const double> sd, const Eigen::Matrix3d& P_phi,
                 NavigationOutput& out) noexcept {
  out.latitude_rad = state.position.latitude_rad;
  out.longitude_rad = state.position.longitude_rad;
  out.height_m = state.position.height_m;
  out.v_n_mps = to_array(state.v_n_mps);
  out.C_b_n = to_array(state.C_b_n);
  const EulerAngles rpy = euler_from_rotation(state.C_b_n);
  out.rpy_rad = {rpy.roll_rad, rpy.pitch_rad, rpy.heading_rad};
  out.gyro_bias_radps = to_array(state.gyro_bias_b_radps);
  out.accel_bias_mps2 = to_array(state.accel_bias_b_mps2);
  for (std::size_t i = 0; i < 3; ++i) {
    out.sd_position_m[i] = sd[kPositionError + i];
    out.sd_velocity_mps[i] = sd[kVelocityError + i];
    out.sd_gyro_bias_radps[i] = sd[kGyroBiasError + i];
    out.sd_accel_bias_mps2[i] = sd[kAccelBiasError + i];
  }
  // phi = T d(roll, pitch, heading), with C_b_n = Rz(heading) Ry(pitch) Rx(roll) perturbed from the left.
  // E-7.
  const double sh = std::sin(rpy.heading_rad);
  const double ch = std::cos(rpy.heading_rad);
  const double cp = std::max(std::cos(rpy.pitch_rad), 1e-6);
  const double sp = std::sin(rpy.pitch_rad);
  Eigen::Matrix3d T;
  T << ch * cp, -sh, 0.0, sh * cp, ch, 0.0, -sp, 0.0, 1.0;
  const Eigen::Matrix3d T_inverse = T.inverse();
  const Eigen::Matrix3d P_rpy = T_inverse * P_phi * T_inverse.transpose();
  for (std::size_t i = 0; i < 3; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    out.sd_rpy_rad[i] = std::sqrt(std::max(P_rpy(k, k), 0.0));
  }
}

}  // namespace imuscope
