#include "estimation/batch/transfer.h"

#include <numbers>

namespace imuscope::batch {

using std::complex;

Matrix3c skew_c(const Vector3c& v) {
  Matrix3c m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

Vector3c omega_dot_of(const Motion& motion) {
  const Matrix3c turning = 0.5 * (motion.arm - motion.arm.transpose());
  return {turning(2, 1), turning(0, 2), turning(1, 0)};
}

namespace {

/// w w' - |w|^2 I of the products xx, yy, zz, xy, xz, yz.
template <typename Products>
Matrix3c centripetal(const Products& p) {
  Matrix3c outer;
  outer << p[0], p[3], p[4], p[3], p[1], p[5], p[4], p[5], p[2];
  return outer - outer.trace() * Matrix3c::Identity();
}

/// B-8a: what the turned mount makes of the forces, f x (S (f - f_0)), in b.
Vector3c of_turned_mount(const Transfer& t, const Motion& motion) {
  const Matrix3c product = motion.force_products * t.compliance_b.transpose();
  return {product(1, 2) - product(2, 1), product(2, 0) - product(0, 2), product(0, 1) - product(1, 0)};
}

}  // namespace

Motion motion_of(const Spectra& reference, Eigen::Index window, Eigen::Index k) {
  const auto row = reference.row(window, k);
  Motion motion;
  motion.omega = row.segment<3>(kOmega).transpose();
  motion.f = row.segment<3>(kForce).transpose();
  // B-6
  motion.arm = skew_c(row.segment<3>(kOmegaDot).transpose());
  motion.shaking = centripetal(row.segment<6>(kShakes));  // B-6a
  motion.arm += centripetal(row.segment<6>(kProducts));
  for (Eigen::Index i = 0; i < 3; ++i) motion.force_products.row(i) = row.segment<3>(kForceProducts + 3 * i);
  return motion;
}

// B-21: with [w' x] and w w' taken apart again
Motion excess_motion(const ReferenceError& error, const Motion& motion) {
  const auto of_product = [](const Eigen::Matrix3d& E, const Matrix3c& product) -> Matrix3c {
    return E * product + product * E.transpose();
  };
  Matrix3c outer = 0.5 * (motion.arm + motion.arm.transpose());
  outer -= 0.5 * outer.trace() * Matrix3c::Identity();
  const Vector3c omega_dot = omega_dot_of(motion);
  const Matrix3c d_outer = of_product(error.gyro, outer);
  Motion excess;
  excess.omega = error.gyro * motion.omega;
  excess.f = error.accel * motion.f;
  excess.arm = skew_c(error.gyro * omega_dot) + d_outer - d_outer.trace() * Matrix3c::Identity();
  excess.force_products = of_product(error.accel, motion.force_products);
  return excess;
}

Transfer::Transfer(const SensorState& sensor, const DeviationVector& deviation)
    : gyro(sensor.C_b_gyro()),
      accel(sensor.C_b_accel()),
      C(sensor.C_b_s),
      C_accel_rotated(sensor.C_s_accel() * sensor.C_b_s),
      g_sensitivity(sensor.g_sensitivity()),
      flexure(sensor.flexure()),
      accel_flexure(sensor.accel_flexure()),
      compliance(sensor.compliance()),
      compliance_b(C.transpose() * compliance * C),
      arm_b_m(sensor.lever_arm_b_m()),
      gyro_bias(sensor.x.segment<3>(kGyroBias)),
      accel_bias(sensor.x.segment<3>(kAccelBias)),
      fade(sensor.x.segment<3>(kAccelFade)),
      delay_s(sensor.x[kAccelDelay]),
      reference_delay_s(sensor.x.segment<2>(kReferenceAccelDelay)),
      dispersion_s(sensor.x.segment<2>(kDispersion)),
      shaking_b_m(sensor.x.segment<3>(kShaking)) {
  for (Eigen::Index i = 0; i < 3; ++i) {
    place_b_m[static_cast<std::size_t>(i)] = C.transpose() * sensor.place_s_m(i);
    gyro_deviation.row(i) = deviation.segment<3>(3 * i).transpose();
    accel_deviation.row(i) = deviation.segment<3>(9 + 3 * i).transpose();
  }
}

// B-7: phi
double flexure_gain(double frequency_hz) {
  const double ratio = frequency_hz / kFlexure_hz;
  return ratio * ratio;
}

complex<double> derivative(double frequency_hz) { return {0.0, 2.0 * std::numbers::pi * frequency_hz}; }

complex<double> dispersed(double frequency_hz) {
  return flexure_gain(frequency_hz) * derivative(frequency_hz);
}

// B-8: each at its place
Vector3c of_lever_arms(const Transfer& t, const Motion& motion) {
  Vector3c felt;
  for (Eigen::Index i = 0; i < 3; ++i) {
    const Eigen::Vector3d arm_b_m = t.arm_b_m + t.place_b_m[static_cast<std::size_t>(i)];
    const Vector3c there = motion.arm * arm_b_m.cast<complex<double>>();
    felt[i] = (t.accel.row(i).cast<complex<double>>() * there).value();
  }
  return felt;
}

// B-8a added
Vector3c accelerometers(const Transfer& t, const Motion& motion) {
  const Vector3c at_reference =
      motion.f + of_turned_mount(t, motion) + motion.shaking * t.shaking_b_m.cast<complex<double>>();
  return t.accel * at_reference + of_lever_arms(t, motion);
}

// B-7: what motion alone makes
Vector3c gyros(const Transfer& t, const Motion& motion, double frequency_hz) {
  const Vector3c in_s = t.C * motion.omega;
  return t.gyro * motion.omega + flexure_gain(frequency_hz) * (t.flexure * in_s) + t.gyro_deviation * in_s;
}

Vector6c predicted(const Transfer& t, const Motion& motion, const Vector3c& study_f, complex<double> constant,
                   double frequency_hz) {
  Vector6c y;
  const Vector3c force_s = t.C * motion.force_at(t.arm_b_m);
  // B-7
  y.head<3>() = gyros(t, motion, frequency_hz) * (1.0 + dispersed(frequency_hz) * t.dispersion_s[0]) +
                derivative(frequency_hz) * (t.compliance * force_s) + t.g_sensitivity * study_f +
                constant * t.gyro_bias;
  const Vector3c felt = accelerometers(t, motion);
  // B-8; the other axes' forces by B-8a
  y.tail<3>() =
      felt * (1.0 + derivative(frequency_hz) * t.delay_s + dispersed(frequency_hz) * t.dispersion_s[1]) +
      (derivative(frequency_hz) * t.reference_delay_s[0] + dispersed(frequency_hz) * t.reference_delay_s[1]) *
          of_lever_arms(t, motion) +
      flexure_gain(frequency_hz) *
          (t.fade.cast<complex<double>>().cwiseProduct(felt) + t.accel_flexure * felt) +
      t.accel_deviation * force_s + constant * t.accel_bias;
  return y;
}

}  // namespace imuscope::batch
