#include "logs/flight_log/message_queue.h"

#include <algorithm>
#include <cmath>

namespace imuscope::flight_log {
namespace {

double square(double x) { return x * x; }

}  // namespace

std::optional<std::int64_t> ns_of(std::optional<double> us) {
  constexpr double kNsPerUs = 1e3;
  // A clock that counts since it was switched on, or since 1970, shows less: three centuries.
  constexpr double kMost_us = 9e15;
  if (!us || !(std::abs(*us) < kMost_us)) return std::nullopt;
  return static_cast<std::int64_t>(std::llround(*us * kNsPerUs));
}

std::int8_t navsat_status_of(double fix_type) {
  constexpr double k3d = 3.0;
  constexpr double kDifferential = 4.0;
  constexpr double kFixed = 6.0;
  if (fix_type == k3d) return 0;
  if (fix_type == kDifferential) return 1;
  return fix_type > kDifferential && fix_type <= kFixed ? std::int8_t{2} : std::int8_t{-1};
}

std::optional<double> positive(std::optional<double> value) {
  return value && *value > 0.0 && std::isfinite(*value) ? value : std::nullopt;
}

template <typename Ros>
void MessageQueue::put(const std::string& topic, const char* type, const Ros& message) {
  auto& known = topics_[topic];
  if (!known) known = std::make_unique<mcap::Topic>(mcap::Topic{topic, "cdr", type, ""});
  mcap::write(cdr_, message);
  waiting_.push_back({known.get(),
                      static_cast<std::uint64_t>(std::max<std::int64_t>(message.header.stamp_ns, 0)),
                      std::string(mcap::text_of(cdr_.bytes()))});
}

void MessageQueue::put_imu(const std::string& topic, std::int64_t time_ns,
                           const std::optional<Triad>& rate_radps, const std::optional<Triad>& force_mps2) {
  mcap::Imu imu;
  imu.header.stamp_ns = time_ns;
  if (rate_radps) imu.angular_velocity = *rate_radps;
  if (force_mps2) imu.linear_acceleration = *force_mps2;
  if (!rate_radps) imu.angular_velocity_covariance[0] = mcap::kNotMeasured;
  if (!force_mps2) imu.linear_acceleration_covariance[0] = mcap::kNotMeasured;
  put(topic, "sensor_msgs/Imu", imu);
}

void MessageQueue::put_fix(const std::string& topic, const GnssFix& fix) {
  constexpr std::uint8_t kApproximated = 1;
  if (fix.v_n_mps && fix.status >= 0) {
    mcap::TwistStamped twist;
    twist.header.stamp_ns = fix.time_ns;
    twist.linear_mps = {(*fix.v_n_mps)[1], (*fix.v_n_mps)[0], -(*fix.v_n_mps)[2]};
    if (fix.speed_sd_mps) {
      constexpr std::size_t kSide = 6;
      for (std::size_t i = 0; i < 3; ++i) twist.covariance[i * kSide + i] = square(*fix.speed_sd_mps) / 3.0;
    }
    put(topic + "/velocity", "geometry_msgs/TwistWithCovarianceStamped", twist);
  }
  mcap::NavSatFix message;
  message.header.stamp_ns = fix.time_ns;
  message.status = fix.status;
  message.latitude_deg = fix.latitude_deg;
  message.longitude_deg = fix.longitude_deg;
  message.altitude_m = fix.height_m;
  if (fix.horizontal_sd_m && fix.vertical_sd_m) {
    const double axis = square(*fix.horizontal_sd_m) / 2.0;
    message.position_covariance = {axis, 0, 0, 0, axis, 0, 0, 0, square(*fix.vertical_sd_m)};
    message.position_covariance_type = kApproximated;
  }
  put(topic, "sensor_msgs/NavSatFix", message);
  if (fix.utc_ns)
    put(topic + "/time", "sensor_msgs/TimeReference",
        mcap::TimeReference{{fix.utc_time_ns, ""}, *fix.utc_ns, ""});
}

std::optional<mcap::Message> MessageQueue::take() {
  if (waiting_.empty()) return std::nullopt;
  Waiting first = std::move(waiting_.front());
  waiting_.pop_front();
  taken_ = std::move(first.data);
  return mcap::Message{first.topic, first.time_ns, first.time_ns, mcap::bytes_of(taken_)};
}

}  // namespace imuscope::flight_log
