#pragma once

/// One S-IMU as the batch estimate knows it: mounting, clock, and what data sheets allow its axes, places and
/// delays to be. B-4 to B-9 in EQUATIONS.md.
///
/// While it is estimated, a crooked triad's frame leans to none of its axes: its matrix is symmetric, and
/// what is believed of it does not depend on the order of its axes. What is published is the gyro triad's
/// frame: x along the x gyro, the y gyro in the x-y plane, so that the gyro matrix is lower triangular, as
/// kalibr has it (in_axes_frame()). C_b_s takes b to this frame.

#include <Eigen/Core>

#include "estimation/navigation/reference_grade.h"

namespace imuscope::batch {

/// Where each quantity stands in the vector of parameters.
enum Parameter : Eigen::Index {
  kPsi = 0,            ///< 3: boresight, rotation vector in b, C = C^ Exp(-psi)
  kLeverArm = 3,       ///< 3: r_bs_b, to the middle of the three accelerometers, m
  kTimeOffset = 6,     ///< z_S(t) shows the motion at t + t_d; at the middle of the record, s
  kClockRate = 7,      ///< growth of t_d, s/s
  kGyroBias = 8,       ///< 3
  kAccelBias = 11,     ///< 3
  kGyroShape = 14,     ///< 6: scale x, y, z; departure of y from x, z from x, z from y from a right angle
  kAlpha = 20,         ///< 3: accelerometer triad against the gyro triad, rotation vector in s
  kAccelShape = 23,    ///< 6: as kGyroShape
  kAccelDelay = 29,    ///< z_f(t) shows the reference's forces at t + t_d + this, s
  kPlaces = 30,        ///< 6: where the three accelerometers are about their middle, by place_basis(), m
  kGSensitivity = 36,  ///< 9: row-major, rad/s per m/s^2
  kFlexure = 45,       ///< 9: row-major; what the body between the IMUs gives way to, at kFlexure_hz
  kAccelFade =
      54,  ///< 3: what each accelerometer shows more of forces at kFlexure_hz; its low-pass, its mount
  kAccelFlexure =
      57,  ///< 6: what each shows of forces along the two others' axes there; a mount that gives way
  kCompliance = 63,  ///< 9: row-major, rad per m/s^2; how far the mount turns under forces
  kDispersion =
      72,  ///< 2: of gyros, of accelerometers; growth of their t_d from slow motion to kFlexure_hz, s
  kReferenceAccelDelay =
      74,  ///< 2: of the reference's accelerometers against its gyros, signed as kAccelDelay, and its growth to
           ///< kFlexure_hz, s
  kShaking =
      76,  ///< 3: as kLeverArm, for rates that are faster than the low-pass; a body's is its lever arm, m
  kParameters = 79,
};

/// Flexure, fading and dispersion grow with the square of the frequency below the body's resonances and the sensors'
/// low-passes; this is where it is stated.
inline constexpr double kFlexure_hz = 5.0;

using ParameterVector = Eigen::Matrix<double, kParameters, 1>;

/// Element `j` of kAccelFlexure: row, and the column beside the diagonal.
[[nodiscard]] constexpr Eigen::Index flexure_row(Eigen::Index j) { return j / 2; }
[[nodiscard]] constexpr Eigen::Index flexure_column(Eigen::Index j) { return (j / 2 + 1 + j % 2) % 3; }

/// What is believed of a sensor before the drive: sd of each kind of imperfection, all of zero mean. The
/// defaults are what data sheets of industrial MEMS allow (MTx: alignment 0.1 deg, scale below 1 %); where a
/// drive shows more, more is taken (B-16).
struct SensorClass {
  double lever_arm_sd_m = 1.0;
  double clock_rate_sd = 20e-6;  ///< two quartzes
  double gyro_bias_sd_radps = 0.05;
  double accel_bias_sd_mps2 = 0.5;
  double gyro_scale_sd = 0.01;
  double accel_scale_sd = 0.01;
  double axis_sd_rad = 1.75e-3;        ///< non-orthogonality, 0.1 deg
  double triad_sd_rad = 1.75e-3;       ///< gyro against accelerometer triad, 0.1 deg
  double accel_delay_sd_s = 1e-3;      ///< of either IMU's accelerometers against its gyros
  double place_sd_m = 0.02;            ///< three chips, each in each axis
  double one_chip_place_sd_m = 0.001;  ///< all three on one chip
  double g_sensitivity_sd = 8.9e-5;    ///< 0.05 deg/s per g
  double flexure_sd = 0.003;
  double accel_fade_sd = 0.01;  ///< a low-pass of 35 Hz
  double accel_flexure_sd = 0.003;
  /// A mount with a resonance of 30 Hz gives way by 1 / (2 pi 30 Hz)^2 = 28 um per m/s^2, here over a metre.
  double compliance_sd = 2.8e-5;
  /// A second-order low-pass of 40 Hz is later by this at 5 Hz than for slow motion, one of first order earlier by less.
  double dispersion_sd_s = 3e-5;
  double shaking_sd_m = 1.0;  ///< and what accelerometers make of fast vibration
  /// What the reference's own axes may be off by: scale; each axis, of a departure that two of them share; its
  /// accelerometer triad against its gyro triad. No drive shows it, as only the two together are seen, so that it stays in
  /// the sd of everything that is a direction or a scale (B-21).
  ReferenceGrade reference = kNavigationGrade;
};

/// The estimate as it stands.
struct SensorState {
  Eigen::Matrix3d C_b_s = Eigen::Matrix3d::Identity();
  ParameterVector x = ParameterVector::Zero();  ///< with psi always zero: C_b_s holds it
  /// Share of each departure from a right angle that stands above the diagonal of a triad's matrix: half
  /// while it is estimated, none in what is published.
  double above = 0.5;

  [[nodiscard]] Eigen::Matrix3d gyro_shape() const;
  [[nodiscard]] Eigen::Matrix3d accel_shape() const;
  [[nodiscard]] Eigen::Matrix3d C_b_gyro() const { return gyro_shape() * C_b_s; }  ///< B-4
  [[nodiscard]] Eigen::Matrix3d C_b_accel() const;                                 ///< B-5
  [[nodiscard]] Eigen::Matrix3d C_s_accel() const;  ///< Exp(-alpha): rotation of the accelerometer triad
  [[nodiscard]] Eigen::Vector3d lever_arm_b_m() const { return x.segment<3>(kLeverArm); }
  /// Place of one accelerometer about the middle of the three, in s, m.
  [[nodiscard]] Eigen::Vector3d place_s_m(Eigen::Index axis) const;
  [[nodiscard]] Eigen::Matrix3d g_sensitivity() const;
  [[nodiscard]] Eigen::Matrix3d flexure() const;
  /// Zero on its diagonal; kAccelFade stands there.
  [[nodiscard]] Eigen::Matrix3d accel_flexure() const;
  [[nodiscard]] Eigen::Matrix3d compliance() const;
  [[nodiscard]] double time_offset_s(double seconds_from_middle) const {
    return x[kTimeOffset] + x[kClockRate] * seconds_from_middle;
  }
  /// Adds a correction; psi turns C_b_s.
  void add(const ParameterVector& correction);
};

/// Derivative of a triad's matrix in its parameter j, 0 to 5.
/// @param above  as in SensorState
[[nodiscard]] Eigen::Matrix3d shape_derivative(Eigen::Index j, double above);

/// The same sensor with triangular matrices, exactly, and the derivative of its parameters in those of the
/// symmetric one, to first order in the departures (B-24).
struct AxesFrame {
  SensorState sensor;
  Eigen::Matrix<double, kParameters, kParameters> derivative;
};
[[nodiscard]] AxesFrame in_axes_frame(const SensorState& symmetric);

/// Errors of the reference's own axes: scales of both triads, leaning axes of both, the rotation between them (B-21).
inline constexpr Eigen::Index kReferenceErrors = 15;

/// sd of each parameter before the drive; infinite for psi and t_d, which the start gives.
[[nodiscard]] ParameterVector prior_sd(const SensorClass& sensor);

}  // namespace imuscope::batch
