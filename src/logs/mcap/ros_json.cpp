#include <algorithm>
#include <nlohmann/json.hpp>

#include "logs/mcap/ros_messages.h"

namespace imuscope::mcap {
namespace {

using nlohmann::json;

/// These messages nest four deep and have at most 90 numbers.
constexpr int kDepthMost = 16;
constexpr std::size_t kMessageMost = 64 * 1024;

/// The document; discarded where it is none of a size and depth that these messages have.
json parse(Bytes message) {
  if (message.size() > kMessageMost) return json(json::value_t::discarded);
  const auto depth_is_fine = [](int depth, json::parse_event_t /*event*/, json& /*parsed*/) {
    return depth < kDepthMost;
  };
  return json::parse(message.begin(), message.end(), depth_is_fine, false);
}

/// Takes members of objects; what is absent or of another type makes the message no good.
class Members {
 public:
  explicit Members(const json& document) : good_(document.is_object()) {}

  const json& member(const json& object, const char* key) {
    static const json kNone;
    const auto found = object.is_object() ? object.find(key) : object.end();
    if (!object.is_object() || found == object.end()) {
      good_ = false;
      return kNone;
    }
    return *found;
  }
  double number(const json& object, const char* key) {
    const json& value = member(object, key);
    if (!value.is_number()) good_ = false;
    return value.is_number() ? value.get<double>() : 0.0;
  }
  std::string text(const json& object, const char* key) {
    const auto found = object.is_object() ? object.find(key) : object.end();
    return object.is_object() && found != object.end() && found->is_string() ? found->get<std::string>()
                                                                             : std::string();
  }
  /// {"sec": 1, "nanosec": 2}, with the names of ROS 2, of JSON schemas ("nsec") and of ROS 1.
  std::int64_t time(const json& object, const char* key) {
    const json& value = member(object, key);
    const std::int64_t seconds = whole(value, {"sec", "secs"});
    constexpr std::int64_t kSecondsMost = 9'000'000'000;
    constexpr std::int64_t kNsPerS = 1'000'000'000;
    const std::int64_t ns = whole(value, {"nanosec", "nsec", "nsecs"});
    if (seconds < -kSecondsMost || seconds > kSecondsMost || ns < 0 || ns >= kNsPerS) {
      good_ = false;
      return 0;
    }
    return seconds * kNsPerS + ns;
  }
  Vector vector(const json& value) { return {number(value, "x"), number(value, "y"), number(value, "z")}; }
  Quaternion quaternion(const json& value) {
    return {number(value, "x"), number(value, "y"), number(value, "z"), number(value, "w")};
  }
  /// Absent: zero, which says that nothing is known.
  template <std::size_t N>
  std::array<double, N> numbers(const json& object, const char* key) {
    std::array<double, N> values{};
    const auto found = object.is_object() ? object.find(key) : object.end();
    if (!object.is_object() || found == object.end()) return values;
    if (!found->is_array() || found->size() != N) {
      good_ = false;
      return values;
    }
    for (std::size_t i = 0; i < N; ++i) {
      if (!(*found)[i].is_number())
        good_ = false;
      else
        values[i] = (*found)[i].get<double>();
    }
    return values;
  }
  RosHeader header(const json& message) {
    const json& value = member(message, "header");
    return {time(value, "stamp"), text(value, "frame_id")};
  }
  [[nodiscard]] bool good() const { return good_; }

 private:
  std::int64_t whole(const json& object, std::initializer_list<const char*> keys) {
    for (const char* key : keys) {
      const auto found = object.is_object() ? object.find(key) : object.end();
      if (object.is_object() && found != object.end() && found->is_number_integer())
        return found->get<std::int64_t>();
    }
    good_ = false;
    return 0;
  }
  bool good_;
};

}  // namespace

bool read_json(Bytes message, Imu& imu) {
  const json document = parse(message);
  Members in(document);
  imu.header = in.header(document);
  imu.angular_velocity = in.vector(in.member(document, "angular_velocity"));
  imu.linear_acceleration = in.vector(in.member(document, "linear_acceleration"));
  imu.angular_velocity_covariance = in.numbers<9>(document, "angular_velocity_covariance");
  imu.linear_acceleration_covariance = in.numbers<9>(document, "linear_acceleration_covariance");
  return in.good();
}

bool read_json(Bytes message, NavSatFix& fix) {
  const json document = parse(message);
  Members in(document);
  fix.header = in.header(document);
  const double status = in.number(in.member(document, "status"), "status");
  fix.status = static_cast<std::int8_t>(std::clamp(status, -1.0, 2.0));
  fix.latitude_deg = in.number(document, "latitude");
  fix.longitude_deg = in.number(document, "longitude");
  fix.altitude_m = in.number(document, "altitude");
  fix.position_covariance = in.numbers<9>(document, "position_covariance");
  fix.position_covariance_type =
      document.is_object() && document.contains("position_covariance_type")
          ? static_cast<std::uint8_t>(std::clamp(in.number(document, "position_covariance_type"), 0.0, 3.0))
          : std::uint8_t{0};
  return in.good();
}

bool read_json(Bytes message, Odometry& odometry) {
  const json document = parse(message);
  Members in(document);
  odometry.header = in.header(document);
  odometry.child_frame_id = in.text(document, "child_frame_id");
  const json& pose = in.member(in.member(document, "pose"), "pose");
  odometry.position_m = in.vector(in.member(pose, "position"));
  odometry.orientation = in.quaternion(in.member(pose, "orientation"));
  const json& twist = in.member(in.member(document, "twist"), "twist");
  odometry.linear_mps = in.vector(in.member(twist, "linear"));
  odometry.angular_radps = in.vector(in.member(twist, "angular"));
  odometry.pose_covariance = in.numbers<36>(in.member(document, "pose"), "covariance");
  odometry.twist_covariance = in.numbers<36>(in.member(document, "twist"), "covariance");
  return in.good();
}

bool read_json(Bytes message, TwistStamped& twist) {
  const json document = parse(message);
  Members in(document);
  twist.header = in.header(document);
  const json& outer = in.member(document, "twist");
  const bool has_covariance = outer.is_object() && outer.contains("twist");
  const json& inner = has_covariance ? in.member(outer, "twist") : outer;
  twist.linear_mps = in.vector(in.member(inner, "linear"));
  twist.angular_radps = in.vector(in.member(inner, "angular"));
  twist.covariance = has_covariance ? in.numbers<36>(outer, "covariance") : Covariance6{};
  return in.good();
}

bool read_json(Bytes message, TimeReference& reference) {
  const json document = parse(message);
  Members in(document);
  reference.header = in.header(document);
  reference.time_ref_ns = in.time(document, "time_ref");
  reference.source = in.text(document, "source");
  return in.good();
}

}  // namespace imuscope::mcap
