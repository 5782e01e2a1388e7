#include "estimation/error_process/error_row.h"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "sample/eigen_arrays.h"

namespace imuscope {

namespace {

using Eigen::Vector3d;

constexpr std::uint32_t kGyroClip = kGyroClipX | kGyroClipY | kGyroClipZ;
constexpr std::uint32_t kAccelClip = kAccelClipX | kAccelClipY | kAccelClipZ;

}  // namespace

ErrorRow error_row(const SImuEpoch& epoch, const Mounting& mounting, const ReferenceBias& bias) noexcept {
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> C_b_s(mounting.C_b_s.data());
  const Vector3d r_bs_b_m = to_eigen(mounting.r_bs_b_m);
  // The epoch's reference is compensated with the biases it names; here with the caller's.
  const Vector3d omega_ib_b = to_eigen(epoch.omega_ib_b_radps) + to_eigen(epoch.reference_gyro_bias_radps) -
                              to_eigen(bias.gyro_radps);
  const Vector3d f_b =
      to_eigen(epoch.f_b_mps2) + to_eigen(epoch.reference_accel_bias_mps2) - to_eigen(bias.accel_mps2);

  // P-1, P-2
  const Vector3d omega_s = C_b_s * omega_ib_b;
  const Vector3d lever =
      to_eigen(epoch.omega_dot_ib_b_radps2).cross(r_bs_b_m) + omega_ib_b.cross(omega_ib_b.cross(r_bs_b_m));
  const Vector3d f_s = C_b_s * (f_b + lever);

  const std::uint32_t flags = epoch.sample.flags;
  ErrorRow row{};
  row.time = epoch.time;
  row.utc = epoch.utc;
  row.counter = epoch.sample.counter;
  row.regime = epoch.regime;
  row.gyro_valid = (flags & kGyroValid) != 0 && (flags & kGyroClip) == 0;
  row.accel_valid = (flags & kAccelValid) != 0 && (flags & kAccelClip) == 0;
  row.e_gyro_radps = to_array(to_eigen(epoch.sample.omega_radps) - omega_s);
  row.e_accel_mps2 = to_array(to_eigen(epoch.sample.f_mps2) - f_s);
  row.predicted_omega_s_radps = to_array(omega_s);
  row.predicted_f_s_mps2 = to_array(f_s);
  row.omega_dot_s_radps2 = to_array(C_b_s * to_eigen(epoch.omega_dot_ib_b_radps2));
  row.omega_ddot_s_radps3 = to_array(C_b_s * to_eigen(epoch.omega_ddot_ib_b_radps3));
  row.f_dot_s_mps3 = to_array(C_b_s * to_eigen(epoch.f_dot_b_mps3));
  return row;
}

ErrorRow live_error_row(const SImuEpoch& epoch) noexcept {
  return error_row(epoch, {epoch.C_b_s, epoch.r_bs_b_m},
                   {epoch.reference_gyro_bias_radps, epoch.reference_accel_bias_mps2});
}

// P-3
ErrorRow without_scale_error(const ErrorRow& row, const ScaleError& scale) noexcept {
  ErrorRow corrected = row;
  for (std::size_t i = 0; i < 3; ++i) {
    corrected.e_gyro_radps[i] -= scale.gyro[i] * row.predicted_omega_s_radps[i];
    corrected.e_accel_mps2[i] -= scale.accel[i] * row.predicted_f_s_mps2[i];
  }
  return corrected;
}

}  // namespace imuscope
