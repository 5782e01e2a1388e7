#include "logs/flight_log/dataflash_messages.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "sample/gps_time.h"

namespace imuscope::flight_log {
namespace {

constexpr double kUsPerMs = 1e3;
constexpr double kDegPerRad = 180.0 / 3.14159265358979323846;
constexpr std::array<std::string_view, 8> kNames{"IMU", "IMT", "ACC", "GYR", "GPS", "GPA", "ISBH", "ISBD"};

/// "IMU2" is the second of "IMU" in logs whose records do not name their instance.
std::pair<std::string_view, int> split(std::string_view name) {
  if (name == "ISBH" || name == "ISBD" || name.size() < 4) return {name, 0};
  const char digit = name[3];
  if (name.size() != 4 || digit < '1' || digit > '9') return {{}, 0};
  return {name.substr(0, 3), digit - '1'};
}

/// When a record was written; the first logs counted milliseconds.
std::optional<double> stamp_us(const Fields& fields) {
  if (const auto us = fields.number("TimeUS")) return us;
  if (const auto ms = fields.number("TimeMS")) return *ms * kUsPerMs;
  return std::nullopt;
}

std::string topic_of(std::string_view name, int instance) {
  return std::string(name) + '/' + std::to_string(instance);
}

bool take_imu(const std::string& topic, const Fields& fields, MessageQueue& queue) {
  const auto time_ns = ns_of(stamp_us(fields));
  auto rate = fields.three("GyrX", "GyrY", "GyrZ");
  auto force = fields.three("AccX", "AccY", "AccZ");
  if (!time_ns || !rate || !force) return false;
  if (fields.number("GH") == 0.0) rate.reset();
  if (fields.number("AH") == 0.0) force.reset();
  queue.put_imu(topic, *time_ns, rate, force);
  return true;
}

/// Increments are means over the time before the record.
bool take_increments(const std::string& topic, const Fields& fields, MessageQueue& queue) {
  const auto us = stamp_us(fields);
  auto rate = fields.three("DelAX", "DelAY", "DelAZ");
  auto force = fields.three("DelVX", "DelVY", "DelVZ");
  const double gyro_s = fields.number("DelaT").value_or(0.0);
  const double accel_s = fields.number("DelvT").value_or(0.0);
  if (!us || !rate || !force || !(gyro_s > 0.0) || !(accel_s > 0.0)) return false;
  const auto time_ns = ns_of(*us - 0.5 * gyro_s / kUs_s);
  if (!time_ns) return false;
  for (double& v : *rate) v /= gyro_s;
  for (double& v : *force) v /= accel_s;
  queue.put_imu(topic, *time_ns, rate, force);
  return true;
}

bool take_fast(bool is_gyro, const std::string& topic, const Fields& fields, MessageQueue& queue) {
  const auto time_ns = ns_of(fields.first_of({"SampleUS", "TimeUS"}));
  const auto value = is_gyro ? fields.three("GyrX", "GyrY", "GyrZ") : fields.three("AccX", "AccY", "AccZ");
  if (!time_ns || !value) return false;
  queue.put_imu(topic, *time_ns, is_gyro ? value : std::nullopt, is_gyro ? std::nullopt : value);
  return true;
}

/// UTC of a week and milliseconds in it, from 1980 on.
std::optional<std::int64_t> utc_of(std::optional<double> week, std::optional<double> ms) {
  constexpr double kWeekMost = 10'000.0;
  constexpr double kMsOfWeek = 604'800'000.0;
  constexpr std::int64_t kNsPerMs = 1'000'000;
  constexpr std::int64_t kSecondsOfWeek = 604'800;
  constexpr std::int64_t kDay_s = 86'400;
  constexpr std::int64_t kNsPerS = 1'000'000'000;
  if (!week || !ms || !(*week > 0.0 && *week < kWeekMost && *ms >= 0.0 && *ms < kMsOfWeek))
    return std::nullopt;
  const auto whole_ms = static_cast<std::int64_t>(*ms);
  const std::int64_t gps_s =
      kGpsEpochDays * kDay_s + static_cast<std::int64_t>(*week) * kSecondsOfWeek + whole_ms / 1000;
  return (gps_s - gps_minus_utc_s(gps_s)) * kNsPerS + whole_ms % 1000 * kNsPerMs;
}

/// Whether it is a number that a counter of 16 bits can show, whatever the log says that it is.
bool is_count(std::optional<double> value) {
  constexpr double kMost = 65535.0;
  return value && *value >= 0.0 && *value <= kMost;
}

}  // namespace

bool ArdupilotMessages::is_taken(std::string_view name) noexcept {
  return std::find(kNames.begin(), kNames.end(), split(name).first) != kNames.end();
}

bool ArdupilotMessages::take(std::string_view full_name, const Fields& fields, MessageQueue& queue) {
  auto [name, instance] = split(full_name);
  if (name == "ISBH") return take_batch(fields);
  if (name == "ISBD") return take_batch_data(fields, queue);
  constexpr double kInstancesMost = 32.0;
  const double given = fields.number("I").value_or(instance);
  if (!(given >= 0.0 && given < kInstancesMost)) return false;
  instance = static_cast<int>(given);
  if (name == "IMU") return take_imu(topic_of(name, instance), fields, queue);
  if (name == "IMT") return take_increments(topic_of(name, instance), fields, queue);
  if (name == "GPS") return take_position(instance, fields, queue);
  if (name == "GPA") return take_accuracy(instance, fields, queue);
  return take_fast(name == "GYR", topic_of(name, instance), fields, queue);
}

void ArdupilotMessages::finish(MessageQueue& queue) {
  while (!waiting_.empty()) give(waiting_.begin()->first, queue);
}

void ArdupilotMessages::give(int instance, MessageQueue& queue) {
  const auto found = waiting_.find(instance);
  if (found == waiting_.end()) return;
  queue.put_fix(topic_of("GPS", instance), found->second.fix);
  if (found->second.fix.status >= 0 && found->second.is_above_the_sea) has_sea_height_ = true;
  waiting_.erase(found);
}

bool ArdupilotMessages::take_position(int instance, const Fields& fields, MessageQueue& queue) {
  give(instance, queue);
  const auto us = stamp_us(fields);
  const auto time_ns = ns_of(us);
  const auto status = fields.number("Status");
  const auto latitude = fields.number("Lat");
  const auto longitude = fields.number("Lng");
  const auto height = fields.number("Alt");
  if (!time_ns || !status || !latitude || !longitude || !height) return false;
  Waiting waiting;
  waiting.stamp_us = *us;
  GnssFix& fix = waiting.fix;
  fix.time_ns = *time_ns;
  fix.status = navsat_status_of(*status);
  fix.latitude_deg = *latitude;
  fix.longitude_deg = *longitude;
  fix.height_m = *height;
  const auto speed = fields.number("Spd");
  const auto course_deg = fields.number("GCrs");
  const auto down = fields.number("VZ");
  if (speed && course_deg && down && std::isfinite(*speed + *course_deg + *down)) {
    const double course = *course_deg / kDegPerRad;
    fix.v_n_mps = Triad{*speed * std::cos(course), *speed * std::sin(course), *down};
  }
  fix.utc_ns = utc_of(fields.first_of({"GWk", "Week"}), fields.first_of({"GMS", "TimeMS"}));
  fix.utc_time_ns = fix.time_ns;
  waiting_[instance] = waiting;
  return true;
}

bool ArdupilotMessages::take_accuracy(int instance, const Fields& fields, MessageQueue& queue) {
  const auto us = stamp_us(fields);
  if (!us) return false;
  const auto found = waiting_.find(instance);
  if (found == waiting_.end() || found->second.stamp_us != *us) return true;
  GnssFix& fix = found->second.fix;
  fix.horizontal_sd_m = positive(fields.number("HAcc"));
  fix.vertical_sd_m = positive(fields.number("VAcc"));
  fix.speed_sd_mps = positive(fields.number("SAcc"));
  if (fields.number("VV") == 0.0) fix.v_n_mps.reset();
  // When the receiver's message came, which is before it was logged.
  const auto sample_ns = ns_of(positive(fields.number("SMS")).value_or(*us / kUsPerMs) * kUsPerMs);
  if (sample_ns && *sample_ns <= fix.time_ns) {
    fix.time_ns = *sample_ns;
    fix.utc_time_ns = *sample_ns;
  }
  // How far the sea is above the ellipsoid, with the sign of height above the sea less that above the
  // ellipsoid.
  const auto undulation = fields.number("Und");
  const bool is_known = undulation && std::isfinite(*undulation) && *undulation != 0.0;
  if (is_known) fix.height_m -= *undulation;
  found->second.is_above_the_sea = !is_known;
  give(instance, queue);
  return true;
}

bool ArdupilotMessages::take_batch(const Fields& fields) {
  batch_ = Batch{};
  const auto number = fields.number("N");
  const auto type = fields.number("type");
  const auto first_us = fields.number("SampleUS");
  const auto rate_hz = positive(fields.number("smp_rate"));
  const auto multiplier = positive(fields.number("mul"));
  const auto samples = fields.number("smp_cnt");
  const auto instance = fields.number("instance");
  if (!number || !type || !ns_of(first_us) || !rate_hz || !multiplier || !is_count(samples) ||
      !is_count(instance))
    return false;
  constexpr double kGyro = 1.0;
  batch_.number = *number;
  batch_.is_gyro = *type == kGyro;
  batch_.topic = topic_of("ISB", static_cast<int>(*instance)) + (batch_.is_gyro ? "/gyro" : "/accel");
  batch_.first_us = *first_us;
  batch_.rate_hz = *rate_hz;
  batch_.multiplier = *multiplier;
  batch_.samples = static_cast<std::size_t>(*samples);
  return true;
}

bool ArdupilotMessages::take_batch_data(const Fields& fields, MessageQueue& queue) const {
  const auto number = fields.number("N");
  const auto piece = fields.number("seqno");
  if (!number || !is_count(piece)) return false;
  // Of a batch whose head was lost nothing is known.
  if (*number != batch_.number) return true;
  for (std::size_t i = 0; i < kSamplesOfBatch; ++i) {
    const std::size_t at = static_cast<std::size_t>(*piece) * kSamplesOfBatch + i;
    if (at >= batch_.samples) break;
    const auto x = fields.number("x", i);
    const auto y = fields.number("y", i);
    const auto z = fields.number("z", i);
    const auto time_ns = ns_of(batch_.first_us + static_cast<double>(at) / batch_.rate_hz / kUs_s);
    if (!x || !y || !z || !time_ns) return false;
    const Triad value{*x / batch_.multiplier, *y / batch_.multiplier, *z / batch_.multiplier};
    queue.put_imu(batch_.topic, *time_ns, batch_.is_gyro ? std::optional(value) : std::nullopt,
                  batch_.is_gyro ? std::nullopt : std::optional(value));
  }
  return true;
}

}  // namespace imuscope::flight_log
