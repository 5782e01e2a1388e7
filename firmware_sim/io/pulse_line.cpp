#include "firmware_sim/io/pulse_line.h"

#include <algorithm>
#include <cmath>

#include "firmware_sim/devices/bytes.h"

namespace imusim {
namespace {

constexpr double kAskEvery_s = 0.02;
constexpr double kBetweenPulses_s = 1.0;
constexpr std::int64_t kQuartzBegin_ns = 77'000'000'000'000;  // a count of its own
constexpr double kHolds_ns = 500.0;
constexpr std::size_t kReadingsMax = 25;
constexpr double kBend_ppm = 40.0;
constexpr double kRateUnit = 1e-9;
constexpr double kNsPerSecond = 1e9;
constexpr std::uint32_t kApart_ns = 60;

}  // namespace

void PulseLine::send(const Emission& pulse) {
  if (options_.clock.is_asleep_at(pulse.ready_s)) return;
  const bool waits = random_.uniform() < options_.late_share;
  const double mean_s = waits ? options_.late_mean_s : options_.interrupt_mean_s;
  newest_pulse_s_ = std::max(newest_pulse_s_, pulse.ready_s);
  waiting_.push_back(pulse.ready_s - mean_s * std::log(1.0 - random_.uniform()));
}

std::int64_t PulseLine::host_ns(double t_s) const {
  return options_.host_begin_ns + std::llround(options_.clock.seconds_at(t_s) * kNsPerSecond);
}

void PulseLine::deliver_until(double t_s, const OnRead& on_read) {
  // After the last pulse nobody asks on: a recording ends there.
  const double until_s = std::min(t_s, newest_pulse_s_ + kBetweenPulses_s);
  for (; static_cast<double>(asked_) * kAskEvery_s < until_s; ++asked_) {
    const double asked_s = static_cast<double>(asked_) * kAskEvery_s;
    if (!options_.clock.is_asleep_at(asked_s)) ask(asked_s, on_read);
  }
}

void PulseLine::ask(double t_s, const OnRead& on_read) {
  if (options_.tells_steering) read_quartz(t_s, on_read);
  while (!waiting_.empty() && waiting_.front() < t_s) {
    tell_pulse(waiting_.front(), t_s, on_read);
    waiting_.pop_front();
  }
}

void PulseLine::read_quartz(double t_s, const OnRead& on_read) {
  const Reading now{host_ns(t_s),
                    kQuartzBegin_ns + std::llround((options_.clock.unsteered_seconds_at(t_s) +
                                                    options_.reading_sd_s * quartz_random_.normal()) *
                                                   kNsPerSecond),
                    0.0};
  const auto off_ns = [&now](const Reading& line) {
    const auto since_ns = static_cast<double>(now.host_ns - line.host_ns);
    return static_cast<double>(now.unsteered_ns - line.unsteered_ns) - since_ns * (1.0 + line.rate);
  };
  readings_.push_back(now);
  if (readings_.size() > kReadingsMax) readings_.pop_front();
  if (readings_.size() < 2 || (has_told_ && std::abs(off_ns(told_)) <= kHolds_ns)) return;
  // Older readings are of another line where the newest two, and the oldest and the newest, do not agree.
  const auto rate_since = [&](const Reading& then) {
    return off_ns(then) / static_cast<double>(now.host_ns - then.host_ns);
  };
  const Reading& before = readings_[readings_.size() - 2];
  if (std::abs(rate_since(before) - rate_since(readings_.front())) > kBend_ppm * 1e-6)
    readings_.erase(readings_.begin(), readings_.end() - 2);
  told_ = now;
  told_.rate = std::round(rate_since(readings_.front()) / kRateUnit) * kRateUnit;
  has_told_ = true;
  Bytes record;
  put_text(record, "PPSq");
  put_le(record, kApart_ns);
  put_le(record, now.host_ns);
  put_le(record, now.unsteered_ns);
  put_le(record, static_cast<std::uint32_t>(static_cast<std::int32_t>(std::lround(told_.rate / kRateUnit))));
  put_le(record, std::uint32_t{0});
  on_read(record, now.host_ns);
}

void PulseLine::tell_pulse(double stamped_s, double asked_s, const OnRead& on_read) {
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

}  // namespace imusim
