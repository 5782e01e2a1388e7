#include "logs/bag/bag_writer.h"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/units.h"
#include "base/wgs84_ellipsoid.h"
#include "logs/bag/message_json.h"

namespace imuscope::bag {
namespace {

/// GNSS solutions as sensor_msgs/NavSatStatus has them.
std::int8_t status_of(GnssSolution solution) {
  switch (solution) {
    case GnssSolution::kNone:
      return -1;
    case GnssSolution::kSingle:
      return 0;
    case GnssSolution::kDifferential:
      return 1;
    case GnssSolution::kFloat:
    case GnssSolution::kFixed:
      return 2;
  }
  return -1;
}

double square(double x) { return x * x; }

void set_diagonal(std::array<double, 36>& covariance, std::size_t from, const Vector3& sd) {
  constexpr std::size_t kSide = 6;
  for (std::size_t i = 0; i < sd.size(); ++i) covariance[(from + i) * kSide + from + i] = square(sd[i]);
}

void set_diagonal(mcap::Covariance3& covariance, const Vector3& variance) {
  covariance = {variance[0], 0, 0, 0, variance[1], 0, 0, 0, variance[2]};
}

std::string number(double value) { return fmt::format("{:.6g}", value); }

mcap::Diagnostic diagnostic_of(const Mounting& mounting) {
  mcap::Diagnostic diagnostic;
  diagnostic.level = mounting.is_usable ? 0 : 1;
  diagnostic.name = "mounting of " + mounting.name;
  diagnostic.message = mounting.status;
  diagnostic.hardware_id = mounting.name;
  constexpr std::array kAxes{"x", "y", "z"};
  for (std::size_t i = 0; i < 3; ++i)
    diagnostic.values.emplace_back(fmt::format("boresight_sd_{}_deg", kAxes[i]),
                                   number(mounting.sd_boresight_rad[i] * kDegPerRad));
  for (std::size_t i = 0; i < 3; ++i)
    diagnostic.values.emplace_back(fmt::format("lever_arm_sd_{}_m", kAxes[i]),
                                   number(mounting.sd_r_bs_b_m[i]));
  diagnostic.values.emplace_back("time_offset_ms", number(mounting.t_d_s * kMsPerS));
  diagnostic.values.emplace_back("time_offset_sd_ms", number(mounting.sd_t_d_s * kMsPerS));
  return diagnostic;
}

/// Metres from the first position in its tangent plane, on the sphere of its own radii: enough for a picture
/// of a drive.
Vector3 local_enu_m(const Navigation& origin, const Navigation& now) {
  const double latitude = origin.latitude_deg * kRadPerDeg;
  const RadiiOfCurvature radii = radii_of_curvature(latitude);
  const double meridian_m = radii.meridian_m + origin.height_m;
  const double normal_m = radii.transverse_m + origin.height_m;
  const double turn_deg = std::remainder(now.longitude_deg - origin.longitude_deg, 360.0);
  return {turn_deg * kRadPerDeg * normal_m * std::cos(latitude),
          (now.latitude_deg - origin.latitude_deg) * kRadPerDeg * meridian_m, now.height_m - origin.height_m};
}

/// Velocity in forward-right-down axes of a vehicle with that attitude.
Vector3 in_body(const mcap::Quaternion& q, const Vector3& v) {
  // v' = q* v q, for a unit quaternion x, y, z, w.
  const Vector3 u{-q[0], -q[1], -q[2]};
  const Vector3 t{2.0 * (u[1] * v[2] - u[2] * v[1]), 2.0 * (u[2] * v[0] - u[0] * v[2]),
                  2.0 * (u[0] * v[1] - u[1] * v[0])};
  return {v[0] + q[3] * t[0] + u[1] * t[2] - u[2] * t[1], v[1] + q[3] * t[1] + u[2] * t[0] - u[0] * t[2],
          v[2] + q[3] * t[2] + u[0] * t[1] - u[1] * t[0]};
}

}  // namespace

BagWriter::BagWriter(mcap::WriterOptions options, mcap::Writer::Sink sink, std::vector<std::string> devices)
    : writer_(std::move(options), std::move(sink)),
      devices_(std::move(devices)),
      raw_(devices_.size()),
      corrected_(devices_.size()) {}

mcap::ChannelId BagWriter::channel(const std::string& topic, const char* type) {
  const auto known = channels_.find(topic);
  if (known != channels_.end()) return known->second;
  auto& schema = schemas_[type];
  if (schema == 0) {
    const auto ros = mcap::ros_schema(type);
    schema = writer_.add_schema(ros.name, "ros2msg", ros.text);
  }
  return channels_[topic] = writer_.add_channel(topic, schema, "cdr");
}

void BagWriter::write(mcap::ChannelId channel, std::int64_t utc_ns) {
  const auto time = static_cast<std::uint64_t>(std::max<std::int64_t>(utc_ns, 0));
  writer_.write(channel, time, time, cdr_.bytes());
}

void BagWriter::add_sample(const Sample& sample, std::int64_t utc_ns, const WhiteVariance& variance) {
  const std::string& name = devices_[sample.device];
  switch (sample.kind) {
    case SampleKind::kImu:
      return add_imu(sample, utc_ns, variance);
    case SampleKind::kGnss:
      return add_gnss(sample.gnss, name, utc_ns);
    case SampleKind::kOdometry: {
      mcap::Odometry odometry;
      odometry.header = {utc_ns, name};
      odometry.child_frame_id = name;
      odometry.linear_mps = {sample.odometry.speed_mps, 0.0, 0.0};
      mcap::write(cdr_, odometry);
      return write(channel("/wheels/" + name, "nav_msgs/Odometry"), utc_ns);
    }
    case SampleKind::kPulse: {
      constexpr std::int64_t kNsPerS = 1'000'000'000;
      const std::int64_t second = (sample.pulse.wall_ns + kNsPerS / 2) / kNsPerS * kNsPerS;
      mcap::write(cdr_, mcap::TimeReference{{utc_ns, name}, second, name});
      return write(channel("/time/" + name, "sensor_msgs/TimeReference"), utc_ns);
    }
    case SampleKind::kAttitude:
    case SampleKind::kSteering:
      return;
  }
}

void BagWriter::add_imu(const Sample& sample, std::int64_t utc_ns, const WhiteVariance& variance) {
  auto& raw = raw_[sample.device];
  const std::string& name = devices_[sample.device];
  if (raw == 0) raw = channel("/imu/" + name + "/raw", "sensor_msgs/Imu");
  imu_.header.stamp_ns = utc_ns;
  imu_.header.frame_id = name;
  imu_.angular_velocity = sample.imu.omega_radps;
  imu_.linear_acceleration = sample.imu.f_mps2;
  set_diagonal(imu_.angular_velocity_covariance, variance.gyro);
  set_diagonal(imu_.linear_acceleration_covariance, variance.accel);
  if ((sample.imu.flags & kGyroValid) == 0) imu_.angular_velocity_covariance = {mcap::kNotMeasured};
  if ((sample.imu.flags & kAccelValid) == 0) imu_.linear_acceleration_covariance = {mcap::kNotMeasured};
  mcap::write(cdr_, imu_);
  write(raw, utc_ns);
}

void BagWriter::add_corrected(const Sample& sample, std::int64_t utc_ns, const Correction& correction,
                              const WhiteVariance& variance) {
  auto& corrected = corrected_[sample.device];
  const std::string& name = devices_[sample.device];
  if (corrected == 0) corrected = channel("/imu/" + name + "/corrected", "sensor_msgs/Imu");
  utc_ns += from_seconds(correction.t_d_s).count();
  Vector3 rate{};
  Vector3 force{};
  WhiteVariance scaled;
  for (std::size_t i = 0; i < 3; ++i) {
    const double gyro = 1.0 / (1.0 + correction.gyro_scale[i]);
    const double accel = 1.0 / (1.0 + correction.accel_scale[i]);
    rate[i] = (sample.imu.omega_radps[i] - correction.gyro_bias_radps[i]) * gyro;
    force[i] = (sample.imu.f_mps2[i] - correction.accel_bias_mps2[i]) * accel;
    scaled.gyro[i] = variance.gyro[i] * gyro * gyro;
    scaled.accel[i] = variance.accel[i] * accel * accel;
  }
  imu_.header.stamp_ns = utc_ns;
  imu_.header.frame_id = aligned_frame(name);
  imu_.angular_velocity = to_base_link(correction.C_b_s, rate);
  imu_.linear_acceleration = to_base_link(correction.C_b_s, force);
  imu_.angular_velocity_covariance = covariance_in_base_link(correction.C_b_s, scaled.gyro);
  imu_.linear_acceleration_covariance = covariance_in_base_link(correction.C_b_s, scaled.accel);
  if ((sample.imu.flags & kGyroValid) == 0) imu_.angular_velocity_covariance = {mcap::kNotMeasured};
  if ((sample.imu.flags & kAccelValid) == 0) imu_.linear_acceleration_covariance = {mcap::kNotMeasured};
  mcap::write(cdr_, imu_);
  write(corrected, utc_ns);
}

/// The velocity stands before its position, so that a reader has both when the position comes.
void BagWriter::add_gnss(const GnssData& gnss, const std::string& name, std::int64_t utc_ns) {
  if ((gnss.flags & kVelocityValid) != 0) {
    mcap::TwistStamped twist;
    twist.header = {utc_ns, kMap};
    twist.linear_mps = enu(gnss.v_n_mps);
    if ((gnss.flags & kHasVelocitySd) != 0) {
      const Vector3& sd = gnss.sd_velocity_mps;
      set_diagonal(twist.covariance, 0, {sd[1], sd[0], sd[2]});
    }
    mcap::write(cdr_, twist);
    write(channel("/gnss/" + name + "/velocity", "geometry_msgs/TwistWithCovarianceStamped"), utc_ns);
  }
  mcap::NavSatFix fix;
  fix.header = {utc_ns, name};
  fix.status = (gnss.flags & kPositionValid) != 0 ? status_of(gnss.solution) : std::int8_t{-1};
  fix.latitude_deg = gnss.latitude_rad * kDegPerRad;
  fix.longitude_deg = gnss.longitude_rad * kDegPerRad;
  fix.altitude_m = gnss.height_m;
  if ((gnss.flags & kHasPositionSd) != 0) {
    constexpr std::uint8_t kDiagonalKnown = 2;
    const Vector3& sd = gnss.sd_position_m;
    set_diagonal(fix.position_covariance, {square(sd[1]), square(sd[0]), square(sd[2])});
    fix.position_covariance_type = kDiagonalKnown;
  }
  mcap::write(cdr_, fix);
  write(channel("/gnss/" + name + "/fix", "sensor_msgs/NavSatFix"), utc_ns);
}

void BagWriter::add_navigation(const Navigation& navigation, std::int64_t utc_ns) {
  if (!origin_) origin_ = navigation;
  mcap::Odometry odometry;
  odometry.header = {utc_ns, kMap};
  odometry.child_frame_id = kBaseLink;
  odometry.position_m = local_enu_m(*origin_, navigation);
  odometry.orientation = base_link_in_map(navigation.rpy_rad);
  const Vector3& sd = navigation.sd_position_m;
  const Vector3& sd_v = navigation.sd_velocity_mps;
  const Vector3& sd_rpy = navigation.sd_rpy_rad;
  set_diagonal(odometry.pose_covariance, 0, {sd[1], sd[0], sd[2]});
  set_diagonal(odometry.pose_covariance, 3, sd_rpy);
  odometry.linear_mps = in_body(odometry.orientation, enu(navigation.v_n_mps));
  // Horizontal components are known alike; which of them points forward changes with the heading.
  const double horizontal = std::max(sd_v[0], sd_v[1]);
  set_diagonal(odometry.twist_covariance, 0, {horizontal, horizontal, sd_v[2]});
  mcap::write(cdr_, odometry);
  write(channel("/navigation/odometry", "nav_msgs/Odometry"), utc_ns);
  mcap::write(cdr_, std::vector<mcap::Transform>{
                        {{utc_ns, kMap}, kBaseLink, odometry.position_m, odometry.orientation}});
  write(channel("/tf", "tf2_msgs/TFMessage"), utc_ns);
}

void BagWriter::add_mountings(const std::vector<Mounting>& mountings, const std::string& reference,
                              std::int64_t utc_ns) {
  constexpr Rotation kSame{1, 0, 0, 0, 1, 0, 0, 0, 1};
  std::vector<mcap::Transform> transforms{{{utc_ns, kBaseLink}, reference, {}, sensor_in_base_link(kSame)}};
  std::vector<mcap::Diagnostic> diagnostics;
  for (const Mounting& mounting : mountings) {
    const mcap::Vector place = flu(mounting.r_bs_b_m);
    transforms.push_back({{utc_ns, kBaseLink}, mounting.name, place, sensor_in_base_link(mounting.C_b_s)});
    transforms.push_back({{utc_ns, kBaseLink}, aligned_frame(mounting.name), place, {0.0, 0.0, 0.0, 1.0}});
    diagnostics.push_back(diagnostic_of(mounting));
  }
  mcap::write(cdr_, transforms);
  write(channel("/tf_static", "tf2_msgs/TFMessage"), utc_ns);
  mcap::write_diagnostics(cdr_, {utc_ns, ""}, diagnostics);
  write(channel("/diagnostics", "diagnostic_msgs/DiagnosticArray"), utc_ns);
}

void BagWriter::add_message(const std::string& topic, const std::string& type, std::string_view json,
                            std::int64_t utc_ns) {
  auto known = channels_.find(topic);
  if (known == channels_.end()) {
    auto& schema = schemas_[type];
    if (schema == 0) schema = writer_.add_schema("imuscope." + type, "jsonschema", schema_text(type));
    known = channels_.emplace(topic, writer_.add_channel(topic, schema, "json")).first;
  }
  const auto time = static_cast<std::uint64_t>(std::max<std::int64_t>(utc_ns, 0));
  writer_.write(known->second, time, time, mcap::bytes_of(json));
}

void BagWriter::attach(const std::string& name, const std::string& media_type, std::int64_t utc_ns,
                       std::string_view data) {
  writer_.attach(name, media_type, static_cast<std::uint64_t>(std::max<std::int64_t>(utc_ns, 0)), data);
}

}  // namespace imuscope::bag
