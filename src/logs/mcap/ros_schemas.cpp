#include <array>
#include <map>
#include <set>
#include <string_view>

#include "logs/mcap/ros_messages.h"

namespace imuscope::mcap {
namespace {

/// Fields of every type that is used, without "msg" in its name.
const std::map<std::string_view, std::string_view>& fields() {
  static const std::map<std::string_view, std::string_view> kFields{
      {"builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"},
      {"std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n"},
      {"geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n"},
      {"geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n"},
      {"geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"},
      {"geometry_msgs/Pose", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"},
      {"geometry_msgs/PoseWithCovariance", "geometry_msgs/Pose pose\nfloat64[36] covariance\n"},
      {"geometry_msgs/Twist", "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n"},
      {"geometry_msgs/TwistWithCovariance", "geometry_msgs/Twist twist\nfloat64[36] covariance\n"},
      {"geometry_msgs/TwistWithCovarianceStamped",
       "std_msgs/Header header\ngeometry_msgs/TwistWithCovariance twist\n"},
      {"geometry_msgs/Transform", "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"},
      {"geometry_msgs/TransformStamped",
       "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n"},
      {"sensor_msgs/NavSatStatus",
       "int8 STATUS_NO_FIX=-1\nint8 STATUS_FIX=0\nint8 STATUS_SBAS_FIX=1\nint8 STATUS_GBAS_FIX=2\n"
       "int8 status\nuint16 SERVICE_GPS=1\nuint16 SERVICE_GLONASS=2\nuint16 SERVICE_COMPASS=4\n"
       "uint16 SERVICE_GALILEO=8\nuint16 service\n"},
      {"sensor_msgs/Imu",
       "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
       "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
       "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n"},
      {"sensor_msgs/NavSatFix",
       "std_msgs/Header header\nsensor_msgs/NavSatStatus status\nfloat64 latitude\nfloat64 longitude\n"
       "float64 altitude\nfloat64[9] position_covariance\nuint8 COVARIANCE_TYPE_UNKNOWN=0\n"
       "uint8 COVARIANCE_TYPE_APPROXIMATED=1\nuint8 COVARIANCE_TYPE_DIAGONAL_KNOWN=2\n"
       "uint8 COVARIANCE_TYPE_KNOWN=3\nuint8 position_covariance_type\n"},
      {"sensor_msgs/TimeReference",
       "std_msgs/Header header\nbuiltin_interfaces/Time time_ref\nstring source\n"},
      {"nav_msgs/Odometry",
       "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n"
       "geometry_msgs/TwistWithCovariance twist\n"},
      {"tf2_msgs/TFMessage", "geometry_msgs/TransformStamped[] transforms\n"},
      {"diagnostic_msgs/KeyValue", "string key\nstring value\n"},
      {"diagnostic_msgs/DiagnosticStatus",
       "byte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\nbyte level\nstring name\nstring message\n"
       "string hardware_id\ndiagnostic_msgs/KeyValue[] values\n"},
      {"diagnostic_msgs/DiagnosticArray",
       "std_msgs/Header header\ndiagnostic_msgs/DiagnosticStatus[] status\n"}};
  return kFields;
}

/// Types that the fields of `type` use, those below them included, in the order in which they are met.
void collect(std::string_view type, std::set<std::string_view>& known, std::string& text) {
  constexpr std::string_view kRule =
      "================================================================================\nMSG: ";
  std::string_view rest = fields().at(type);
  while (!rest.empty()) {
    const std::string_view line = rest.substr(0, rest.find('\n'));
    rest.remove_prefix(line.size() + 1);
    const std::string_view used = line.substr(0, line.find_first_of(" ["));
    const auto found = fields().find(used);
    if (found == fields().end() || !known.insert(found->first).second) continue;
    text += kRule;
    text += found->first;
    text += '\n';
    text += found->second;
    collect(found->first, known, text);
  }
}

}  // namespace

RosSchema ros_schema(const std::string& type) {
  RosSchema schema;
  const std::size_t slash = type.find('/');
  schema.name = type.substr(0, slash) + "/msg" + type.substr(slash);
  schema.text = fields().at(type);
  std::set<std::string_view> known;
  collect(type, known, schema.text);
  return schema;
}

}  // namespace imuscope::mcap
