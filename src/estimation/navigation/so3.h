#pragma once

/// Rotations. C_x_y rotates components from x to y: v_y = C_x_y * v_x. Angles in radians. Attitude angles are
/// the zyx sequence (heading, pitch, roll) from local north-east-down to forward-right-down.
/// All functions are pure, thread-safe and do not allocate.

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace imuscope {

/// [v x], so that skew(a) * b = a x b.
inline Eigen::Matrix3d skew(const Eigen::Vector3d& v) noexcept {
  Eigen::Matrix3d m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

/// Exp: rotation vector to rotation matrix (N-1). Exact for any angle, and for angle 0.
[[nodiscard]] Eigen::Matrix3d exp_so3(const Eigen::Vector3d& phi_rad) noexcept;

/// Log: rotation matrix to the rotation vector of length [0, pi] (N-2). Well conditioned at 0 and at pi.
[[nodiscard]] Eigen::Vector3d log_so3(const Eigen::Matrix3d& C) noexcept;

/// Nearest rotation matrix, through the quaternion: for matrices of any origin.
[[nodiscard]] Eigen::Matrix3d reorthonormalized(const Eigen::Matrix3d& C) noexcept;

/// One Newton step towards the nearest rotation matrix (N-16): for products of rotations, whose rounding it
/// removes.
[[nodiscard]] Eigen::Matrix3d tidied(const Eigen::Matrix3d& C) noexcept;

/// Attitude of a body relative to local NED.
struct EulerAngles {
  double roll_rad = 0.0;     ///< (-pi, pi]
  double pitch_rad = 0.0;    ///< [-pi/2, pi/2], nose up positive
  double heading_rad = 0.0;  ///< [0, 2 pi), clockwise from true north
};

/// C_b_n of the attitude angles (N-4).
[[nodiscard]] Eigen::Matrix3d rotation_from_euler(const EulerAngles& angles) noexcept;

/// Attitude angles of C_b_n. At |pitch| = pi/2 roll and heading are not unique; roll 0 is returned there.
[[nodiscard]] EulerAngles euler_from_rotation(const Eigen::Matrix3d& C_b_n) noexcept;

/// Hamilton quaternion, scalar part not negative.
[[nodiscard]] Eigen::Quaterniond quaternion_from_rotation(const Eigen::Matrix3d& C) noexcept;

/// Angle brought to (-pi, pi].
[[nodiscard]] double wrapped_angle(double angle_rad) noexcept;

}  // namespace imuscope
