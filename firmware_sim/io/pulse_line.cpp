#include "firmware_sim/io/pulse_line.h"

#include <cmath>

#include "firmware_sim/devices/bytes.h"

namespace imusim {
namespace {

constexpr double kAskEvery_s = 0.1;
constexpr double kNsPerSecond = 1e9;
constexpr std::uint32_t kApart_ns = 60;

}  // namespace

void PulseLine::send(const Emission& pulse) {
  if (options_.clock.is_asleep_at(pulse.ready_s)) return;
  const bool waits = random_.uniform() < options_.late_share;
  const double mean_s = waits ? options_.late_mean_s : options_.interrupt_mean_s;
  waiting_.push_back(pulse.ready_s - mean_s * std::log(1.0 - random_.uniform()));
}

std::int64_t PulseLine::host_ns(double t_s) const {
  return options_.host_begin_ns + std::llround(options_.clock.seconds_at(t_s) * kNsPerSecond);
}

void PulseLine::deliver_until(double t_s, const OnRead& on_read) {
  while (!waiting_.empty()) {
    const double stamped_s = waiting_.front();
    const double asked_s = (std::floor(stamped_s / kAskEvery_s) + 1.0) * kAskEvery_s;
    if (asked_s >= t_s) return;
    waiting_.pop_front();
    Bytes record;
    put_text(record, "PPSa");
    put_le(record, ++count_);
    put_le(record, host_ns(stamped_s));
    const Gps wall = gps_after(options_.wall_begin, options_.clock.seconds_at(stamped_s));
    put_le(record, static_cast<std::int64_t>(utc_without_leap_second(wall).time_since_epoch().count()));
    put_le(record, kApart_ns);
    put_le(record, std::uint32_t{0});
    on_read(record, host_ns(asked_s));
  }
}

}  // namespace imusim
