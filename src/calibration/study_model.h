#pragma once

/// The measurement model of one S-IMU: what it should show, given the reference, and how that changes with
/// every state. Truth = estimate + error, except the boresight: C_b_s = C^_b_s Exp(-psi), psi in b.
/// EQUATIONS.md C-1 to C-12, C-16. Core: no allocation.

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>

#include "alignment/reference_window.h"
#include "calibration/covariance_kernel.h"
#include "calibration/estimator_config.h"

namespace imuscope {

/// What is estimated of one S-IMU.
struct StudyState {
  Eigen::Matrix3d C_b_s = Eigen::Matrix3d::Identity();
  Eigen::Vector3d r_bs_b_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d gyro_bias_s_radps = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel_bias_s_mps2 = Eigen::Vector3d::Zero();
  double t_d_s = 0.0;
  Eigen::Vector3d gyro_scale = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel_scale = Eigen::Vector3d::Zero();
  Eigen::Matrix3d accel_turn = Eigen::Matrix3d::Identity();  ///< A: C_accel = C_b_s A
  double accel_t_d_s = 0.0;                                  ///< on top of t_d_s
};

/// Where the states of one S-IMU stand in the filter's error state.
struct StudyLayout {
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
  std::size_t first = 0;
  std::size_t size = 0;  ///< 19 with the default blocks

  /// States of the StudyBlock bits, from index `first` on.
  static StudyLayout make(std::uint32_t blocks, std::size_t first) noexcept;
};

/// The reference's own white noise in the kinematics, per axis of b.
struct ReferenceNoise {
  double omega_radps = 0.0;       ///< sd of one rate
  double omega_dot_radps2 = 0.0;  ///< sd of the differentiated rate
  double f_mps2 = 0.0;            ///< sd of one force
};

/// One triad's prediction and its derivatives.
struct StudyMeasurement {
  Eigen::Vector3d predicted = Eigen::Vector3d::Zero();  ///< in s
  SparseMeasurement H;
  Eigen::Matrix3d reference_covariance = Eigen::Matrix3d::Zero();  ///< the reference's noise, as seen in s
};

/// First columns of the R biases in the filter's error state; StudyLayout::kAbsent leaves them out.
struct ReferenceBiasColumns {
  std::size_t gyro = StudyLayout::kAbsent;
  std::size_t accel = StudyLayout::kAbsent;
};

/// z_w = (I + S_g) C w + b_g. `b` is compensated with the R biases. C-3 to C-6.
[[nodiscard]] StudyMeasurement gyro_measurement(const StudyState& state, const StudyLayout& layout,
                                                const ReferenceBiasColumns& reference,
                                                const ReferenceKinematics& b,
                                                const ReferenceNoise& noise) noexcept;

/// z_f = (I + S_a) C A (f + M r) + b_a, `b` compensated, at t + t_d + accel_t_d, with M = [w x][w x] + [w'
/// x]. C-7 to C-11, C-16.
[[nodiscard]] StudyMeasurement accel_measurement(const StudyState& state, const StudyLayout& layout,
                                                 const ReferenceBiasColumns& reference,
                                                 const ReferenceKinematics& b,
                                                 const ReferenceNoise& noise) noexcept;

/// Adds an estimated error, given as the filter's whole error state, to the state. C-12.
void inject(StudyState& state, const StudyLayout& layout, std::span<const double> error) noexcept;

/// Variance of white noise that does to slow states what the fast Gauss-Markov process does, plus the white
/// part: sd_w^2 + sd_f^2 (1 + phi)/(1 - phi), phi = exp(-dt/tau). C-14.
[[nodiscard]] double inflated_variance(double white_sd, double fast_sd, double fast_time_constant_s,
                                       double dt_s) noexcept;

}  // namespace imuscope
