#include "drivers/transport/steering_watch.h"

#include <algorithm>
#include <cmath>
#include <ctime>

namespace imuscope {

namespace {

constexpr int kReadings = 5;
constexpr Duration kTogether = std::chrono::nanoseconds(500);
/// A thread that lost the processor between the two clocks has read nothing.
constexpr Duration kApartMax = std::chrono::microseconds(2);
/// What was told holds as long as it gives the quartz to this.
constexpr Duration kHolds = std::chrono::nanoseconds(500);
/// Of a reading, 1 sigma.
constexpr double kReadingSd_s = 0.2e-6;
constexpr double kBendSigmas = 4.0;
constexpr double kRecordedRate = 1e-9;

HostTime clock_now(clockid_t clock) noexcept {
  timespec now{};
  clock_gettime(clock, &now);
  return host_time_from_ns(0) + std::chrono::seconds(now.tv_sec) + Duration(now.tv_nsec);
}

/// Of the quartz from one reading to a later one.
double rate_between(const ClockSteering& from, const ClockSteering& to) noexcept {
  return to_seconds((to.unsteered - from.unsteered) - (to.time - from.time)) /
         to_seconds(to.time - from.time);
}

double rate_sd(const ClockSteering& from, const ClockSteering& to) noexcept {
  return std::sqrt(2.0) * kReadingSd_s / to_seconds(to.time - from.time);
}

}  // namespace

ClockSteering read_quartz() noexcept {
  ClockSteering best;
  best.apart = Duration::max();
  for (int i = 0; i < kReadings && best.apart > kTogether; ++i) {
    const HostTime before = clock_now(CLOCK_MONOTONIC);
    const HostTime unsteered = clock_now(CLOCK_MONOTONIC_RAW);
    const HostTime after = clock_now(CLOCK_MONOTONIC);
    if (after - before < best.apart) best = {before + (after - before) / 2, unsteered, 0.0, after - before};
  }
  return best;
}

/// Before the newest reading.
const ClockSteering& SteeringWatch::past(std::size_t back) const noexcept {
  return readings_[(n_ - back) % kPast];
}

/// How many readings ago the line bent, where the rate since then is another one than before.
std::optional<std::size_t> SteeringWatch::find_bend(const ClockSteering& reading) const noexcept {
  for (const std::size_t back : {std::size_t{1}, std::size_t{4}, std::size_t{16}, kPast}) {
    if (back >= on_line_) return std::nullopt;
    const ClockSteering& then = past(back);
    const double change = rate_between(then, reading) - rate_between(bend_, then);
    if (std::abs(change) > kBendSigmas * std::hypot(rate_sd(then, reading), rate_sd(bend_, then)))
      return back;
  }
  return std::nullopt;
}

/// By how much the readings on the present line lie beside one through the newest: it was the one that stood
/// out.
Duration SteeringWatch::mean_beside(const ClockSteering& line) const noexcept {
  const std::size_t n = std::min(on_line_, kPast);
  Duration sum{};
  for (std::size_t back = 1; back <= n; ++back) {
    const Duration since = past(back).time - line.time;
    sum += past(back).unsteered - line.unsteered - since - from_seconds(line.rate * to_seconds(since));
  }
  return sum / static_cast<std::int64_t>(n + 1);
}

std::optional<ClockSteering> SteeringWatch::look(const ClockSteering& reading) noexcept {
  if (reading.apart > kApartMax || (n_ > 0 && reading.time <= past(1).time)) return std::nullopt;
  if (n_ == 0) bend_ = reading;
  const auto keep = [&] {
    readings_[n_ % kPast] = reading;
    ++n_;
    ++on_line_;
  };
  if (has_told_) {
    const Duration since = reading.time - told_.time;
    const Duration off =
        told_.unsteered + since + from_seconds(told_.rate * to_seconds(since)) - reading.unsteered;
    if (std::chrono::abs(off) <= kHolds + reading.apart / 2) {
      keep();
      return std::nullopt;
    }
  }
  if (n_ == 0) {
    keep();
    return std::nullopt;
  }
  // Either the clock is steered otherwise for some readings, or the line was not known well enough.
  if (const auto back = find_bend(reading)) {
    bend_ = past(*back);
    on_line_ = *back;
  }
  told_ = reading;
  // As it is recorded: what is told is compared with what was understood.
  told_.rate = std::round(rate_between(bend_, reading) / kRecordedRate) * kRecordedRate;
  told_.unsteered += mean_beside(told_);
  has_told_ = true;
  keep();
  return told_;
}

}  // namespace imuscope
