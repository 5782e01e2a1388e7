#include "logs/flight_log/ulog_messages.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace imuscope::flight_log {
namespace {

constexpr std::array<std::string_view, 6> kTaken{"sensor_combined", "vehicle_imu", "sensor_gyro",
                                                 "sensor_accel",    "sensor_gps",  "vehicle_gps_position"};

/// A span that old logs write in seconds and new ones in whole microseconds; zero where there is none.
double span_s(const Fields& fields, std::string_view name) {
  const auto value = fields.number(name);
  if (!value || !std::isfinite(*value)) return 0.0;
  return fields.is_float(name) ? *value : *value * kUs_s;
}

bool all_finite(const Triad& v) {
  return std::all_of(v.begin(), v.end(), [](double x) { return std::isfinite(x); });
}

/// Means over what came before the time in the message: they are of the middle.
TakenOfPx4 take_combined(const std::string& topic, const Fields& fields, MessageQueue& queue) {
  constexpr double kInvalid_us = 2147483647.0;
  const auto stamp_us = fields.number("timestamp");
  const auto rate = fields.three("gyro_rad");
  auto force = fields.three("accelerometer_m_s2");
  if (!stamp_us || !rate) return {};
  const double gyro_s = span_s(fields, "gyro_integral_dt");
  const auto time_ns = ns_of(*stamp_us - 0.5 * gyro_s / kUs_s);
  if (!time_ns) return {};
  TakenOfPx4 taken{true, {}};
  const double later_us = fields.number("accelerometer_timestamp_relative").value_or(0.0);
  if (later_us == kInvalid_us) force.reset();
  if (force)
    taken.accel_lag_s = later_us * kUs_s - 0.5 * (span_s(fields, "accelerometer_integral_dt") - gyro_s);
  queue.put_imu(topic, *time_ns, rate, force);
  return taken;
}

TakenOfPx4 take_vehicle_imu(const std::string& topic, const Fields& fields, MessageQueue& queue) {
  const auto stamp_us = fields.first_of({"timestamp_sample", "timestamp"});
  auto rate = fields.three("delta_angle");
  auto force = fields.three("delta_velocity");
  // One span for both in the first versions.
  const double gyro_s = span_s(fields, fields.has("delta_angle_dt") ? "delta_angle_dt" : "dt");
  const double accel_s = span_s(fields, fields.has("delta_velocity_dt") ? "delta_velocity_dt" : "dt");
  if (!stamp_us || !rate || !(gyro_s > 0.0)) return {};
  const auto time_ns = ns_of(*stamp_us - 0.5 * gyro_s / kUs_s);
  if (!time_ns) return {};
  for (double& v : *rate) v /= gyro_s;
  if (!(accel_s > 0.0)) force.reset();
  if (force) {
    for (double& v : *force) v /= accel_s;
  }
  queue.put_imu(topic, *time_ns, rate, force);
  return {true, {}};
}

TakenOfPx4 take_sensor(bool is_gyro, const std::string& topic, const Fields& fields, MessageQueue& queue) {
  const auto time_ns = ns_of(fields.first_of({"timestamp_sample", "timestamp"}));
  const auto value = fields.three("x", "y", "z");
  if (!time_ns || !value) return {};
  queue.put_imu(topic, *time_ns, is_gyro ? value : std::nullopt, is_gyro ? std::nullopt : value);
  return {true, {}};
}

TakenOfPx4 take_gnss(const std::string& topic, const Fields& fields, MessageQueue& queue) {
  constexpr double kDegPerCount = 1e-7;
  constexpr double kMetresPerUnit = 1e-3;
  const auto stamp_us = fields.number("timestamp");
  const auto fix_type = fields.number("fix_type");
  const auto time_ns = ns_of(stamp_us);
  if (!time_ns || !fix_type) return {};
  GnssFix fix;
  fix.time_ns = *time_ns;
  fix.status = navsat_status_of(*fix_type);
  if (fields.has("latitude_deg")) {
    fix.latitude_deg = fields.number("latitude_deg").value_or(0.0);
    fix.longitude_deg = fields.number("longitude_deg").value_or(0.0);
    fix.height_m = fields.number("altitude_ellipsoid_m").value_or(0.0);
  } else {
    const auto latitude = fields.number("lat");
    const auto longitude = fields.number("lon");
    const auto height = fields.first_of({"alt_ellipsoid", "alt"});
    if (!latitude || !longitude || !height) return {};
    fix.latitude_deg = *latitude * kDegPerCount;
    fix.longitude_deg = *longitude * kDegPerCount;
    fix.height_m = *height * kMetresPerUnit;
  }
  const auto north = fields.number("vel_n_m_s");
  const auto east = fields.number("vel_e_m_s");
  const auto down = fields.number("vel_d_m_s");
  if (north && east && down && fields.number("vel_ned_valid").value_or(1.0) != 0.0)
    fix.v_n_mps = Triad{*north, *east, *down};
  if (fix.v_n_mps && !all_finite(*fix.v_n_mps)) fix.v_n_mps.reset();
  fix.horizontal_sd_m = positive(fields.number("eph"));
  fix.vertical_sd_m = positive(fields.number("epv"));
  fix.speed_sd_mps = positive(fields.number("s_variance_m_s"));
  const auto utc_us = fields.number("time_utc_usec");
  const auto utc_stamp_ns = ns_of(*stamp_us + fields.number("timestamp_time_relative").value_or(0.0));
  if (utc_us && *utc_us > 0.0 && utc_stamp_ns) {
    fix.utc_ns = ns_of(utc_us);
    fix.utc_time_ns = *utc_stamp_ns;
  }
  queue.put_fix(topic, fix);
  return {true, {}};
}

}  // namespace

bool is_taken_of_px4(std::string_view type) noexcept {
  return std::find(kTaken.begin(), kTaken.end(), type) != kTaken.end();
}

TakenOfPx4 take_of_px4(std::string_view type, const std::string& topic, const Fields& fields,
                       MessageQueue& queue) {
  if (type == "sensor_combined") return take_combined(topic, fields, queue);
  if (type == "vehicle_imu") return take_vehicle_imu(topic, fields, queue);
  if (type == "sensor_gyro" || type == "sensor_accel")
    return take_sensor(type == "sensor_gyro", topic, fields, queue);
  return take_gnss(topic, fields, queue);
}

}  // namespace imuscope::flight_log
