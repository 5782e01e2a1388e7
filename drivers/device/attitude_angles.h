#pragma once

/// Attitude as roll, pitch and heading of forward-right-down axes, and the rotations that devices send.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "base/units.h"

namespace imuscope {

/// Row-major.
using Matrix3 = std::array<double, 9>;

[[nodiscard]] constexpr Matrix3 multiply(const Matrix3& a, const Matrix3& b) noexcept {
  Matrix3 c{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      for (std::size_t k = 0; k < 3; ++k) c[3 * i + j] += a[3 * i + k] * b[3 * k + j];
    }
  }
  return c;
}

[[nodiscard]] constexpr Matrix3 transpose(const Matrix3& a) noexcept {
  return {a[0], a[3], a[6], a[1], a[4], a[7], a[2], a[5], a[8]};
}

/// out = a v. Written component by component, since this runs for every sample.
constexpr void rotate(const Matrix3& a, const std::array<double, 3>& v, std::array<double, 3>& out) noexcept {
  const double x = v[0];
  const double y = v[1];
  const double z = v[2];
  out[0] = a[0] * x + a[1] * y + a[2] * z;
  out[1] = a[3] * x + a[4] * y + a[5] * z;
  out[2] = a[6] * x + a[7] * y + a[8] * z;
}

/// Euler angles of forward-right-down axes against north-east-down: roll right side down, pitch nose up,
/// heading clockwise from north.
struct RollPitchHeading {
  double roll_rad;
  double pitch_rad;
  double heading_rad;
};

/// Body (forward-right-down) to north-east-down: Rz(heading) Ry(pitch) Rx(roll). The same product for any
/// right-handed pair of frames.
[[nodiscard]] inline Matrix3 rotation_of(const RollPitchHeading& rph) noexcept {
  const double cr = std::cos(rph.roll_rad), sr = std::sin(rph.roll_rad);
  const double cp = std::cos(rph.pitch_rad), sp = std::sin(rph.pitch_rad);
  const double ch = std::cos(rph.heading_rad), sh = std::sin(rph.heading_rad);
  return {cp * ch,
          sr * sp * ch - cr * sh,
          cr * sp * ch + sr * sh,
          cp * sh,
          sr * sp * sh + cr * ch,
          cr * sp * sh - sr * ch,
          -sp,
          sr * cp,
          cr * cp};
}

/// Of a rotation, quaternion scalar first; its length does not matter.
[[nodiscard]] inline Matrix3 rotation_of(const std::array<double, 4>& q) noexcept {
  const double n = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
  const double s = 2.0 / n;
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  return {1.0 - s * (y * y + z * z), s * (x * y - w * z),       s * (x * z + w * y),
          s * (x * y + w * z),       1.0 - s * (x * x + z * z), s * (y * z - w * x),
          s * (x * z - w * y),       s * (y * z + w * x),       1.0 - s * (x * x + y * y)};
}

/// Inverse of rotation_of().
[[nodiscard]] inline RollPitchHeading angles_of(const Matrix3& c) noexcept {
  return {std::atan2(c[7], c[8]), -std::asin(std::clamp(c[6], -1.0, 1.0)), std::atan2(c[3], c[0])};
}

/// Into [0, 2 pi).
[[nodiscard]] inline double to_positive_turn(double angle_rad) noexcept {
  if (angle_rad >= 0.0 && angle_rad < 2.0 * kPi) return angle_rad;  // as a rule: fmod() is slow
  const double turned = std::fmod(angle_rad, 2.0 * kPi);
  const double positive = turned < 0.0 ? turned + 2.0 * kPi : turned;
  return positive >= 2.0 * kPi ? 0.0 : positive;
}

}  // namespace imuscope
