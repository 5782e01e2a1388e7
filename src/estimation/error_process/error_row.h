#pragma once

/// The error process of an S-IMU: what it said minus what the reference predicts for its place, attitude and
/// instant. S samples are never resampled and estimated S biases never subtracted: they are what is modelled.
///
///   e_g = z_g - C_b_s omega_ib_b
///   e_a = z_a - C_b_s (f_b + omega' x r + omega x (omega x r))
///
/// with the reference compensated for its own biases and taken at the S sample's time plus t_d. After Stebler
/// et al. (2014), section II.A, eq. (1) and (2); equation numbers P-1 to P-3 in EQUATIONS.md.

#include <cstdint>

#include "estimation/calibration/estimator.h"
#include "sample/sample.h"

namespace imuscope {

/// One row of the error process, in s axes.
struct ErrorRow {
  HostTime time;         ///< of validity of the S sample
  UtcStamp utc;          ///< of the motion that it shows: later by the time offset
  std::int64_t counter;  ///< of the device, unwrapped
  Regime regime;
  bool gyro_valid;  ///< the sample held rates and no axis was at the end of its range
  bool accel_valid;
  Vector3 e_gyro_radps;
  Vector3 e_accel_mps2;
  /// What the reference predicts at the S-IMU's place: the dynamics that the error is studied against.
  Vector3 predicted_omega_s_radps;
  Vector3 predicted_f_s_mps2;
  Vector3 omega_dot_s_radps2;
  Vector3 omega_ddot_s_radps3;
  Vector3 f_dot_s_mps3;  ///< of the reference's place: without the lever arm's part, which needs omega'''
};

/// Mounting with which the prediction is made.
struct Mounting {
  Matrix3 C_b_s{1, 0, 0, 0, 1, 0, 0, 0, 1};
  Vector3 r_bs_b_m{};
};

/// R biases with which the reference is compensated, in b.
struct ReferenceBias {
  Vector3 gyro_radps{};
  Vector3 accel_mps2{};
};

/// The row of one epoch, for a mounting and R biases of the caller's choice.
/// Thread: any. Allocates: never.
ErrorRow error_row(const SImuEpoch& epoch, const Mounting& mounting, const ReferenceBias& bias) noexcept;

/// The row with the estimate as it stood at the epoch: what is published live.
ErrorRow live_error_row(const SImuEpoch& epoch) noexcept;

/// Scale error of a triad, fraction per axis.
struct ScaleError {
  Vector3 gyro{};
  Vector3 accel{};
};

/// The row without the part that a scale error explains: e - s * prediction, per axis (P-3).
ErrorRow without_scale_error(const ErrorRow& row, const ScaleError& scale) noexcept;

}  // namespace imuscope
