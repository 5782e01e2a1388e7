#pragma once

/// The messages of ROS 2 that a run is made of and comes as: sensor_msgs, nav_msgs, tf2_msgs,
/// diagnostic_msgs, with their ros2msg schemas, in CDR both ways, from the bytes of ROS 1 and from JSON.
///
/// Frames are those of ROS (REP 103): positions and velocities east-north-up, bodies forward-left-up. Who
/// fills them in turns forward-right-down and north-east-down into these.

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "logs/mcap/cdr.h"

namespace imuscope::mcap {

/// Row-major covariance of three numbers.
using Covariance3 = std::array<double, 9>;
/// Of position or velocity and rotation: x, y, z, about x, about y, about z.
using Covariance6 = std::array<double, 36>;
using Vector = std::array<double, 3>;
/// x, y, z, w.
using Quaternion = std::array<double, 4>;

/// The first number of a covariance that says that there is no such measurement (sensor_msgs/Imu).
inline constexpr double kNotMeasured = -1.0;

/// std_msgs/Header.
struct RosHeader {
  std::int64_t stamp_ns = 0;
  std::string frame_id;
};

/// sensor_msgs/Imu.
struct Imu {
  RosHeader header;
  Quaternion orientation{0.0, 0.0, 0.0, 1.0};
  Covariance3 orientation_covariance{kNotMeasured};
  Vector angular_velocity{};  ///< rad/s
  Covariance3 angular_velocity_covariance{};
  Vector linear_acceleration{};  ///< specific force, m/s^2
  Covariance3 linear_acceleration_covariance{};
};

/// sensor_msgs/NavSatFix.
struct NavSatFix {
  RosHeader header;
  std::int8_t status = -1;    ///< -1 none, 0 fix, 1 satellite-based, 2 ground-based augmentation
  std::uint16_t service = 1;  ///< GPS
  double latitude_deg = 0.0;
  double longitude_deg = 0.0;
  double altitude_m = 0.0;                    ///< above the WGS-84 ellipsoid
  Covariance3 position_covariance{};          ///< m^2, east, north, up
  std::uint8_t position_covariance_type = 0;  ///< 0 unknown, 1 approximated, 2 diagonal known, 3 known
};

/// nav_msgs/Odometry.
struct Odometry {
  RosHeader header;
  std::string child_frame_id;
  Vector position_m{};
  Quaternion orientation{0.0, 0.0, 0.0, 1.0};
  Covariance6 pose_covariance{};
  Vector linear_mps{};  ///< in the child's frame
  Vector angular_radps{};
  Covariance6 twist_covariance{};
};

/// geometry_msgs/TwistWithCovarianceStamped; of a TwistStamped nothing is known of how good it is.
struct TwistStamped {
  RosHeader header;
  Vector linear_mps{};
  Vector angular_radps{};
  Covariance6 covariance{};
};

/// sensor_msgs/TimeReference.
struct TimeReference {
  RosHeader header;  ///< by the clock of the PC
  std::int64_t time_ref_ns = 0;
  std::string source;
};

/// geometry_msgs/TransformStamped.
struct Transform {
  RosHeader header;
  std::string child_frame_id;
  Vector translation_m{};
  Quaternion rotation{0.0, 0.0, 0.0, 1.0};
};

/// diagnostic_msgs/DiagnosticStatus.
struct Diagnostic {
  std::uint8_t level = 0;  ///< 0 ok, 1 warning, 2 error, 3 stale
  std::string name;
  std::string message;
  std::string hardware_id;
  std::vector<std::pair<std::string, std::string>> values;
};

void write(CdrWriter& out, const Imu& imu);
void write(CdrWriter& out, const NavSatFix& fix);
void write(CdrWriter& out, const Odometry& odometry);
void write(CdrWriter& out, const TwistStamped& twist);
void write(CdrWriter& out, const TimeReference& reference);
/// tf2_msgs/TFMessage.
void write(CdrWriter& out, const std::vector<Transform>& transforms);
/// diagnostic_msgs/DiagnosticArray.
void write_diagnostics(CdrWriter& out, const RosHeader& header, const std::vector<Diagnostic>& diagnostics);

/// False where the bytes are no such message.
[[nodiscard]] bool read(Bytes message, Imu& imu, Wire wire = Wire::kCdr);
[[nodiscard]] bool read(Bytes message, NavSatFix& fix, Wire wire = Wire::kCdr);
[[nodiscard]] bool read(Bytes message, Odometry& odometry, Wire wire = Wire::kCdr);
/// A TwistStamped, too.
[[nodiscard]] bool read(Bytes message, TwistStamped& twist, Wire wire = Wire::kCdr);
[[nodiscard]] bool read(Bytes message, TimeReference& reference, Wire wire = Wire::kCdr);
[[nodiscard]] bool read_json(Bytes message, Imu& imu);
[[nodiscard]] bool read_json(Bytes message, NavSatFix& fix);
[[nodiscard]] bool read_json(Bytes message, Odometry& odometry);
[[nodiscard]] bool read_json(Bytes message, TwistStamped& twist);
[[nodiscard]] bool read_json(Bytes message, TimeReference& reference);

/// A schema as MCAP's profile "ros2" has it.
struct RosSchema {
  std::string name;  ///< "sensor_msgs/msg/Imu"
  std::string text;  ///< ros2msg, with the types that it uses
};
/// @param type  "sensor_msgs/Imu", "sensor_msgs/NavSatFix", "sensor_msgs/TimeReference", "nav_msgs/Odometry",
/// "geometry_msgs/TwistWithCovarianceStamped", "tf2_msgs/TFMessage", "diagnostic_msgs/DiagnosticArray"
[[nodiscard]] RosSchema ros_schema(const std::string& type);

}  // namespace imuscope::mcap
