#include "logs/mcap/ros_messages.h"

namespace imuscope::mcap {
namespace {

constexpr std::int64_t kNsPerS = 1'000'000'000;

void write_time(CdrWriter& out, std::int64_t ns) {
  std::int64_t seconds = ns / kNsPerS;
  std::int64_t rest = ns % kNsPerS;
  if (rest < 0) {
    rest += kNsPerS;
    --seconds;
  }
  out.number(static_cast<std::int32_t>(seconds));
  out.number(static_cast<std::uint32_t>(rest));
}

std::int64_t read_time(CdrReader& in) {
  const auto seconds = in.number<std::int32_t>();
  return seconds * kNsPerS + in.number<std::uint32_t>();
}

void write_header(CdrWriter& out, const RosHeader& header) {
  write_time(out, header.stamp_ns);
  out.text(header.frame_id);
}

void read_header(CdrReader& in, RosHeader& header) {
  // ROS 1 counts its messages.
  if (in.wire() == Wire::kRos1) (void)in.number<std::uint32_t>();
  header.stamp_ns = read_time(in);
  header.frame_id = in.text();
}

}  // namespace

void write(CdrWriter& out, const Imu& imu) {
  out.begin();
  write_header(out, imu.header);
  out.numbers(imu.orientation);
  out.numbers(imu.orientation_covariance);
  out.numbers(imu.angular_velocity);
  out.numbers(imu.angular_velocity_covariance);
  out.numbers(imu.linear_acceleration);
  out.numbers(imu.linear_acceleration_covariance);
}

void write(CdrWriter& out, const NavSatFix& fix) {
  out.begin();
  write_header(out, fix.header);
  out.number(fix.status);
  out.number(fix.service);
  out.number(fix.latitude_deg);
  out.number(fix.longitude_deg);
  out.number(fix.altitude_m);
  out.numbers(fix.position_covariance);
  out.number(fix.position_covariance_type);
}

void write(CdrWriter& out, const Odometry& odometry) {
  out.begin();
  write_header(out, odometry.header);
  out.text(odometry.child_frame_id);
  out.numbers(odometry.position_m);
  out.numbers(odometry.orientation);
  out.numbers(odometry.pose_covariance);
  out.numbers(odometry.linear_mps);
  out.numbers(odometry.angular_radps);
  out.numbers(odometry.twist_covariance);
}

void write(CdrWriter& out, const TwistStamped& twist) {
  out.begin();
  write_header(out, twist.header);
  out.numbers(twist.linear_mps);
  out.numbers(twist.angular_radps);
  out.numbers(twist.covariance);
}

void write(CdrWriter& out, const TimeReference& reference) {
  out.begin();
  write_header(out, reference.header);
  write_time(out, reference.time_ref_ns);
  out.text(reference.source);
}

void write(CdrWriter& out, const std::vector<Transform>& transforms) {
  out.begin();
  out.number(static_cast<std::uint32_t>(transforms.size()));
  for (const Transform& transform : transforms) {
    write_header(out, transform.header);
    out.text(transform.child_frame_id);
    out.numbers(transform.translation_m);
    out.numbers(transform.rotation);
  }
}

void write_diagnostics(CdrWriter& out, const RosHeader& header, const std::vector<Diagnostic>& diagnostics) {
  out.begin();
  write_header(out, header);
  out.number(static_cast<std::uint32_t>(diagnostics.size()));
  for (const Diagnostic& diagnostic : diagnostics) {
    out.number(diagnostic.level);
    out.text(diagnostic.name);
    out.text(diagnostic.message);
    out.text(diagnostic.hardware_id);
    out.number(static_cast<std::uint32_t>(diagnostic.values.size()));
    for (const auto& [key, value] : diagnostic.values) {
      out.text(key);
      out.text(value);
    }
  }
}

bool read(Bytes message, Imu& imu, Wire wire) {
  CdrReader in(message, wire);
  read_header(in, imu.header);
  imu.orientation = in.numbers<4>();
  imu.orientation_covariance = in.numbers<9>();
  imu.angular_velocity = in.numbers<3>();
  imu.angular_velocity_covariance = in.numbers<9>();
  imu.linear_acceleration = in.numbers<3>();
  imu.linear_acceleration_covariance = in.numbers<9>();
  return in.good();
}

bool read(Bytes message, NavSatFix& fix, Wire wire) {
  CdrReader in(message, wire);
  read_header(in, fix.header);
  fix.status = in.number<std::int8_t>();
  fix.service = in.number<std::uint16_t>();
  fix.latitude_deg = in.number<double>();
  fix.longitude_deg = in.number<double>();
  fix.altitude_m = in.number<double>();
  fix.position_covariance = in.numbers<9>();
  fix.position_covariance_type = in.number<std::uint8_t>();
  return in.good();
}

bool read(Bytes message, Odometry& odometry, Wire wire) {
  CdrReader in(message, wire);
  read_header(in, odometry.header);
  odometry.child_frame_id = in.text();
  odometry.position_m = in.numbers<3>();
  odometry.orientation = in.numbers<4>();
  odometry.pose_covariance = in.numbers<36>();
  odometry.linear_mps = in.numbers<3>();
  odometry.angular_radps = in.numbers<3>();
  odometry.twist_covariance = in.numbers<36>();
  return in.good();
}

bool read(Bytes message, TwistStamped& twist, Wire wire) {
  CdrReader in(message, wire);
  read_header(in, twist.header);
  twist.linear_mps = in.numbers<3>();
  twist.angular_radps = in.numbers<3>();
  const bool is_twist = in.good();
  twist.covariance = in.numbers<36>();
  if (!in.good()) twist.covariance = {};
  return is_twist;
}

bool read(Bytes message, TimeReference& reference, Wire wire) {
  CdrReader in(message, wire);
  read_header(in, reference.header);
  reference.time_ref_ns = read_time(in);
  reference.source = in.text();
  return in.good();
}

}  // namespace imuscope::mcap
