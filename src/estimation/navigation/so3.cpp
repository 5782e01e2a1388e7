#include "estimation/navigation/so3.h"

#include <cmath>

#include "base/units.h"

namespace imuscope {

namespace {

/// Below this angle the series to fourth order is exact in double precision.
constexpr double kSmallAngle_rad = 1e-3;

/// sin(x)/x and (1 - cos x)/x^2.
struct RotationCoefficients {
  double a;
  double b;
};

RotationCoefficients coefficients(double angle) noexcept {
  const double x2 = angle * angle;
  if (angle < kSmallAngle_rad) {
    return {1.0 - x2 / 6.0 * (1.0 - x2 / 20.0), 0.5 - x2 / 24.0 * (1.0 - x2 / 30.0)};
  }
  // Half angles: 1 - cos x would cancel.
  const double half_sine = std::sin(0.5 * angle);
  return {std::sin(angle) / angle, 2.0 * half_sine * half_sine / x2};
}

}  // namespace

// N-1
Eigen::Matrix3d exp_so3(const Eigen::Vector3d& phi_rad) noexcept {
  const RotationCoefficients k = coefficients(phi_rad.norm());
  const Eigen::Matrix3d X = skew(phi_rad);
  return Eigen::Matrix3d::Identity() + k.a * X + k.b * (X * X);
}

// N-2, through the quaternion, which stays well conditioned at both ends.
Eigen::Vector3d log_so3(const Eigen::Matrix3d& C) noexcept {
  const Eigen::Quaterniond q = quaternion_from_rotation(C);
  const double sine = q.vec().norm();
  if (sine < kSmallAngle_rad) {
    return q.vec() * (2.0 / q.w() * (1.0 - sine * sine / (3.0 * q.w() * q.w())));
  }
  return q.vec() * (2.0 * std::atan2(sine, q.w()) / sine);
}

Eigen::Matrix3d reorthonormalized(const Eigen::Matrix3d& C) noexcept {
  return quaternion_from_rotation(C).toRotationMatrix();
}

// N-16
Eigen::Matrix3d tidied(const Eigen::Matrix3d& C) noexcept {
  return 0.5 * C * (3.0 * Eigen::Matrix3d::Identity() - C.transpose() * C);
}

// N-4
Eigen::Matrix3d rotation_from_euler(const EulerAngles& angles) noexcept {
  const double sr = std::sin(angles.roll_rad);
  const double cr = std::cos(angles.roll_rad);
  const double sp = std::sin(angles.pitch_rad);
  const double cp = std::cos(angles.pitch_rad);
  const double sh = std::sin(angles.heading_rad);
  const double ch = std::cos(angles.heading_rad);
  Eigen::Matrix3d C_b_n;
  C_b_n << cp * ch, sr * sp * ch - cr * sh, cr * sp * ch + sr * sh,  //
      cp * sh, sr * sp * sh + cr * ch, cr * sp * sh - sr * ch,       //
      -sp, sr * cp, cr * cp;
  return C_b_n;
}

EulerAngles euler_from_rotation(const Eigen::Matrix3d& C_b_n) noexcept {
  const double cos_pitch = std::hypot(C_b_n(0, 0), C_b_n(1, 0));
  EulerAngles angles;
  angles.pitch_rad = std::atan2(-C_b_n(2, 0), cos_pitch);
  constexpr double kVerticalCosine = 1e-9;
  if (cos_pitch > kVerticalCosine) {
    angles.roll_rad = std::atan2(C_b_n(2, 1), C_b_n(2, 2));
    angles.heading_rad = std::atan2(C_b_n(1, 0), C_b_n(0, 0));
  } else {
    angles.heading_rad = std::atan2(-C_b_n(0, 1), C_b_n(1, 1));
  }
  if (angles.heading_rad < 0.0) angles.heading_rad += 2.0 * kPi;
  return angles;
}

Eigen::Quaterniond quaternion_from_rotation(const Eigen::Matrix3d& C) noexcept {
  Eigen::Quaterniond q(C);
  q.normalize();
  if (q.w() < 0.0) q.coeffs() = -q.coeffs();
  return q;
}

double wrapped_angle(double angle_rad) noexcept {
  const double wrapped = std::remainder(angle_rad, 2.0 * kPi);
  return wrapped <= -kPi ? wrapped + 2.0 * kPi : wrapped;
}

}  // namespace imuscope
