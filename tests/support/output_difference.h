#pragma once

/// How far two runs' estimates lie apart, in shares of their published sd.

#include <algorithm>
#include <cmath>

#include "estimation/calibration/estimator.h"

namespace imuscope::test {

/// What replays on other processors and by other builds have to agree to.
inline constexpr double kShareOfSd = 1e-6;

inline double share_of_sd(const Vector3& a, const Vector3& b, const Vector3& sd) {
  double share = 0.0;
  // Where something is known exactly, it has to be the same.
  for (std::size_t i = 0; i < 3; ++i) {
    const double apart = std::abs(a[i] - b[i]);
    if (apart > 0.0) share = std::max(share, apart / sd[i]);
  }
  return share;
}

/// Infinite where they are not in the same state; 0 where neither has an estimate yet.
inline double difference(const SImuOutput& a, const SImuOutput& b) {
  if (a.status != b.status) return HUGE_VAL;
  if (!has_estimate(a.status)) return 0.0;
  return std::max({share_of_sd(a.psi_rad, b.psi_rad, b.sd_psi_rad),
                   share_of_sd(a.r_bs_b_m, b.r_bs_b_m, b.sd_r_bs_b_m),
                   share_of_sd(a.gyro_bias_radps, b.gyro_bias_radps, b.sd_gyro_bias_radps),
                   share_of_sd(a.accel_bias_mps2, b.accel_bias_mps2, b.sd_accel_bias_mps2),
                   share_of_sd(a.gyro_scale, b.gyro_scale, b.sd_gyro_scale),
                   share_of_sd(a.accel_scale, b.accel_scale, b.sd_accel_scale),
                   share_of_sd({a.t_d_s, 0.0, 0.0}, {b.t_d_s, 0.0, 0.0}, {b.sd_t_d_s, 1.0, 1.0})});
}

inline double difference(const NavigationOutput& a, const NavigationOutput& b) {
  if (a.status != b.status) return HUGE_VAL;
  if (a.status != NavigationStatus::kNavigating) return 0.0;
  return std::max({share_of_sd(a.v_n_mps, b.v_n_mps, b.sd_velocity_mps),
                   share_of_sd(a.rpy_rad, b.rpy_rad, b.sd_rpy_rad),
                   share_of_sd({0.0, 0.0, a.height_m}, {0.0, 0.0, b.height_m}, b.sd_position_m)});
}

}  // namespace imuscope::test
