#pragma once

/// What the S-IMU shows of the body's motion at one frequency, and how that follows its parameters (B-6 to
/// B-8).

#include <Eigen/Core>
#include <array>
#include <complex>

#include "estimation/batch/sensor_model.h"
#include "estimation/batch/spectra.h"

namespace imuscope::batch {

using Vector3c = Eigen::Vector3cd;
using Matrix3c = Eigen::Matrix3cd;
using Vector6c = Eigen::Matrix<std::complex<double>, 6, 1>;

/// Deviations of a band from a rigid body: two 3 x 3 matrices, gyro and accelerometer, row-major.
inline constexpr Eigen::Index kDeviations = 18;
using DeviationVector = Eigen::Matrix<double, kDeviations, 1>;

/// Columns of the reference's spectra.
enum ReferenceColumn : Eigen::Index {
  kOmega = 0,
  kForce = 3,
  kOmegaDot = 6,
  kProducts = 9,        ///< omega_i omega_j: xx, yy, zz, xy, xz, yz
  kForceProducts = 15,  ///< 9: f_i (f_j - its mean), with gravity in f, less its mean; row-major
  kShakes = 24,         ///< 6: as kProducts, of what of omega the low-pass takes
  kReferenceColumns = 30,
};

/// The body's motion in one window at one frequency.
struct Motion {
  Vector3c omega;
  Vector3c f;
  Matrix3c arm;  ///< acceleration of a point of the body per metre of its lever arm: [omega' x] + omega
                 ///< omega' - |omega|^2 (B-6)

  Matrix3c force_products;              ///< f (f - f_0)', with gravity in f; f_0: its mean
  Matrix3c shaking = Matrix3c::Zero();  ///< as `arm`, of rates that are faster than the low-pass

  [[nodiscard]] Vector3c force_at(const Eigen::Vector3d& lever_arm_m) const {
    return f + arm * lever_arm_m.cast<std::complex<double>>();
  }
};

[[nodiscard]] Matrix3c skew_c(const Vector3c& v);

/// omega' of `arm`.
[[nodiscard]] Vector3c omega_dot_of(const Motion& motion);

/// As the reference shows it.
[[nodiscard]] Motion motion_of(const Spectra& reference, Eigen::Index window, Eigen::Index k);

/// What the reference would be off by if its rates were (I + E_gyro) and its forces (I + E_accel) of the true ones,
/// to first order (B-21).
struct ReferenceError {
  Eigen::Matrix3d gyro = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d accel = Eigen::Matrix3d::Zero();
};
[[nodiscard]] Motion excess_motion(const ReferenceError& error, const Motion& motion);

/// A sensor with what does not change from window to window worked out.
struct Transfer {
  Eigen::Matrix3d gyro, accel, C, C_accel_rotated, g_sensitivity, flexure, accel_flexure, compliance,
      gyro_deviation, accel_deviation;
  Eigen::Matrix3d compliance_b;  ///< from forces in b to a turn in b
  Eigen::Vector3d arm_b_m;
  std::array<Eigen::Vector3d, 3> place_b_m;
  Eigen::Vector3d gyro_bias, accel_bias;
  Eigen::Vector3d fade;
  double delay_s;
  Eigen::Vector2d reference_delay_s;
  Eigen::Vector2d dispersion_s;
  Eigen::Vector3d shaking_b_m;

  Transfer(const SensorState& sensor, const DeviationVector& deviation);
};

/// (f / kFlexure_hz)^2
[[nodiscard]] double flexure_gain(double frequency_hz);
/// i w phi: what a dispersion of one second makes of a motion (B-7).
[[nodiscard]] std::complex<double> dispersed(double frequency_hz);
/// i w: what a derivative in time is at a frequency.
[[nodiscard]] std::complex<double> derivative(double frequency_hz);

/// Of B-8: what the lever arm and the places make the three accelerometers feel.
[[nodiscard]] Vector3c of_lever_arms(const Transfer& t, const Motion& motion);
/// B-8 without the delays: what the three accelerometers feel, each at its place.
[[nodiscard]] Vector3c accelerometers(const Transfer& t, const Motion& motion);
/// B-7: rates as the gyros show them, less bias and what forces add.
[[nodiscard]] Vector3c gyros(const Transfer& t, const Motion& motion, double frequency_hz);
/// All six, with biases.
/// @param study_f   the forces that the S-IMU itself shows
/// @param constant  transform of a constant of one
[[nodiscard]] Vector6c predicted(const Transfer& t, const Motion& motion, const Vector3c& study_f,
                                 std::complex<double> constant, double frequency_hz);

}  // namespace imuscope::batch
