#pragma once

/// The measurement model of one S-IMU: what it should show, given the reference, and how that changes with
/// every state. Truth = estimate + error, except the boresight: C_b_s = C^_b_s Exp(-psi), psi in b.
/// EQUATIONS.md C-1 to C-12, C-16, C-16a, C-18 to C-20, C-23, C-26. Core: no allocation.

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>

#include "estimation/alignment/reference_window.h"
#include "estimation/calibration/covariance_kernel.h"
#include "estimation/calibration/estimator_config.h"

namespace imuscope {

/// What is estimated of one S-IMU.
struct SImuState {
  Eigen::Matrix3d C_b_s = Eigen::Matrix3d::Identity();
  Eigen::Vector3d r_bs_b_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d gyro_bias_s_radps = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel_bias_s_mps2 = Eigen::Vector3d::Zero();
  double t_d_s = 0.0;
  Eigen::Vector3d gyro_scale = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel_scale = Eigen::Vector3d::Zero();
  Eigen::Matrix3d accel_turn = Eigen::Matrix3d::Identity();  ///< A: C_accel = C_b_s A
  double accel_t_d_s = 0.0;                                  ///< on top of t_d_s
  /// How far each pair of axes leans towards each other, yz, xz, xy: half of their departure from a right
  /// angle, rad. The frame s leans to none of its axes.
  Eigen::Vector3d gyro_axes = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel_axes = Eigen::Vector3d::Zero();
  /// Where the accelerometers are about their middle, by place_basis(), m.
  Eigen::Matrix<double, 6, 1> places_s_m = Eigen::Matrix<double, 6, 1>::Zero();
  Eigen::Matrix3d g_sensitivity = Eigen::Matrix3d::Zero();  ///< rad/s per m/s^2
  /// Of the R-IMU's accelerometers against its gyros, signed as accel_t_d_s.
  double reference_accel_t_d_s = 0.0;
};

/// Where the states of one S-IMU stand in the filter's error state.
struct SImuLayout {
  static constexpr std::size_t kAbsent = static_cast<std::size_t>(-1);
  std::size_t psi = kAbsent;
  std::size_t r = kAbsent;
  std::size_t gyro_bias = kAbsent;
  std::size_t accel_bias = kAbsent;
  std::size_t t_d = kAbsent;
  std::size_t gyro_scale = kAbsent;
  std::size_t accel_scale = kAbsent;
  std::size_t accel_boresight = kAbsent;
  std::size_t accel_t_d = kAbsent;
  std::size_t gyro_axes = kAbsent;
  std::size_t accel_axes = kAbsent;
  std::size_t places = kAbsent;         ///< 6
  std::size_t g_sensitivity = kAbsent;  ///< 9, row by row
  std::size_t reference_accel_t_d = kAbsent;
  std::size_t first = 0;
  std::size_t size = 0;  ///< 19 with the default blocks

  /// States of the SImuBlock bits, from index `first` on.
  static SImuLayout make(std::uint32_t blocks, std::size_t first) noexcept;
};

/// The reference's motion over the samples of one update: their weighted means. C-15.
struct ReferenceMean {
  Eigen::Vector3d omega_radps = Eigen::Vector3d::Zero();
  Eigen::Vector3d omega_dot_radps2 = Eigen::Vector3d::Zero();
  Eigen::Vector3d omega_ddot_radps3 = Eigen::Vector3d::Zero();
  Eigen::Vector3d f_mps2 = Eigen::Vector3d::Zero();
  Eigen::Vector3d f_dot_mps3 = Eigen::Vector3d::Zero();
  Eigen::Matrix3d omega_omega = Eigen::Matrix3d::Zero();  ///< mean of w w', (rad/s)^2

  ReferenceMean() = default;
  ReferenceMean(const ReferenceKinematics& b) noexcept;  // NOLINT(google-explicit-constructor): one sample
  /// Adds `weight` times `b`.
  void add(double weight, const ReferenceKinematics& b) noexcept;
  void scale(double factor) noexcept;
  /// Takes biases out, and moves all by dt_s to first order.
  void compensate(const Eigen::Vector3d& gyro_bias_radps, const Eigen::Vector3d& accel_bias_mps2) noexcept;
  void move(double dt_s) noexcept;
};

/// The reference's own white noise in the kinematics, per axis of b.
struct ReferenceNoise {
  double omega_radps = 0.0;       ///< sd of one rate
  double omega_dot_radps2 = 0.0;  ///< sd of the differentiated rate
  double f_mps2 = 0.0;            ///< sd of one force
};

/// One triad's prediction and its derivatives.
struct SImuMeasurement {
  Eigen::Vector3d predicted = Eigen::Vector3d::Zero();  ///< in s
  SparseMeasurement H;
  Eigen::Matrix3d reference_covariance = Eigen::Matrix3d::Zero();  ///< the reference's noise, as seen in s
};

/// First columns of the R biases in the filter's error state; SImuLayout::kAbsent leaves them out.
struct ReferenceBiasColumns {
  std::size_t gyro = SImuLayout::kAbsent;
  std::size_t accel = SImuLayout::kAbsent;
};

/// z_w = G C w + K C (f + M r) + b_g, G = I + diag(s_g) + E_g. `b` is compensated with the R biases. C-3 to
/// C-6, C-18, C-20.
/// @param for_H  the same motion as the derivatives may believe it, C-13
[[nodiscard]] SImuMeasurement gyro_measurement(const SImuState& state, const SImuLayout& layout,
                                               const ReferenceBiasColumns& reference, const ReferenceMean& b,
                                               const ReferenceMean& for_H,
                                               const ReferenceNoise& noise) noexcept;

/// z_f,i = [B C A (f + M (r + C' d_i))]_i + b_a, B = I + diag(s_a) + E_a, `b` compensated, at t + t_d +
/// accel_t_d, with M = [w x][w x] + [w' x], of the reference's rates, later by reference_accel_t_d. C-7 to C-11, C-16,
/// C-16a, C-18, C-19.
[[nodiscard]] SImuMeasurement accel_measurement(const SImuState& state, const SImuLayout& layout,
                                                const ReferenceBiasColumns& reference, const ReferenceMean& b,
                                                const ReferenceMean& for_H,
                                                const ReferenceNoise& noise) noexcept;

/// How far the states that enter as products are from known: variances of psi, r and the time offset of the
/// triad.
struct LinearisationSpread {
  Eigen::Matrix3d psi_rad2 = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d r_m2 = Eigen::Matrix3d::Zero();
  double t_d_s2 = 0.0;
};

/// Covariance, in s, of what the derivatives above leave out to second order: psi by r, by t_d and by psi, r
/// by t_d. It fades as the states become known. C-23.
[[nodiscard]] Eigen::Matrix3d second_order_rate(const SImuState& state, const ReferenceMean& b,
                                                const LinearisationSpread& spread) noexcept;
[[nodiscard]] Eigen::Matrix3d second_order_force(const SImuState& state, const ReferenceMean& b,
                                                 const LinearisationSpread& spread) noexcept;

/// What the two triads should show; `b` as above.
[[nodiscard]] Eigen::Vector3d predicted_rate(const SImuState& state, const ReferenceMean& b) noexcept;
[[nodiscard]] Eigen::Vector3d predicted_force(const SImuState& state, const ReferenceMean& b) noexcept;

/// Adds an estimated error, given as the filter's whole error state, to the state. C-12.
void inject(SImuState& state, const SImuLayout& layout, std::span<const double> error) noexcept;

/// Variance of white noise that does to slow states what the fast Gauss-Markov process does, plus the white
/// part: sd_w^2 + sd_f^2 (1 + phi)/(1 - phi), phi = exp(-dt/tau). C-14.
[[nodiscard]] double inflated_variance(double white_sd, double fast_sd, double fast_time_constant_s,
                                       double dt_s) noexcept;

}  // namespace imuscope
