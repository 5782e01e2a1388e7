#pragma once

/// Our frames in those of ROS (REP 103, REP 105): bodies forward-left-up, the local frame east-north-up.
///
/// - base_link: b (forward-right-down) turned about its forward axis
/// - NAME: axes and origin of an IMU as its samples have them (of the reference b itself)
/// - NAME_aligned: axes of base_link, origin of the S-IMU: where corrected samples are
/// - map: east-north-up at the run's first position

#include <array>
#include <string>

#include "logs/mcap/ros_messages.h"
#include "sample/sample.h"

namespace imuscope::bag {

using Rotation = std::array<double, 9>;  ///< row-major

inline constexpr const char* kBaseLink = "base_link";
inline constexpr const char* kMap = "map";
[[nodiscard]] std::string aligned_frame(const std::string& name);

/// A vector in forward-right-down axes, in forward-left-up ones, and back.
[[nodiscard]] inline Vector3 flu(const Vector3& v) noexcept { return {v[0], -v[1], -v[2]}; }
/// North-east-down as east-north-up, and back.
[[nodiscard]] inline Vector3 enu(const Vector3& v) noexcept { return {v[1], v[0], -v[2]}; }

/// Attitude of the vehicle as roll, pitch and heading of b relative to north-east-down: base_link relative to
/// map.
[[nodiscard]] mcap::Quaternion base_link_in_map(const Vector3& rpy_rad);
/// Attitude of s relative to base_link, of the rotation that takes b to s: takes what is resolved in s to
/// base_link.
[[nodiscard]] mcap::Quaternion sensor_in_base_link(const Rotation& C_b_s);
/// Covariance in base_link of three independent variances in s.
[[nodiscard]] mcap::Covariance3 covariance_in_base_link(const Rotation& C_b_s, const Vector3& variance_s);
/// C_b_s transposed times a vector in s, forward-left-up.
[[nodiscard]] Vector3 to_base_link(const Rotation& C_b_s, const Vector3& v_s) noexcept;

}  // namespace imuscope::bag
