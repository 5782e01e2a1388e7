#pragma once

/// Time, as types. Three time scales meet in imuscope and never mix by accident:
/// - HostTime: CLOCK_MONOTONIC of the vehicle PC. Arrival stamps and, through a clock map, times of validity.
/// - UtcTime: UTC as the R-IMU and the GNSS receiver tag it.
/// - a device's own count, which stays a plain integer inside its driver.

#include <chrono>
#include <cmath>
#include <cstdint>

namespace imuscope {

using Duration = std::chrono::nanoseconds;

/// The vehicle PC's monotonic clock as a time scale. now() belongs to the service alone: the core is handed
/// its time, so that a replay can hand it another.
struct HostClock {
  using duration = Duration;
  using rep = duration::rep;
  using period = duration::period;
  using time_point = std::chrono::time_point<HostClock>;
  static constexpr bool is_steady = true;
};

using HostTime = HostClock::time_point;
using UtcTime = std::chrono::sys_time<Duration>;

constexpr HostTime host_time_from_ns(std::int64_t ns) { return HostTime{Duration{ns}}; }
constexpr std::int64_t to_ns(HostTime time) { return time.time_since_epoch().count(); }
constexpr UtcTime utc_time_from_ns(std::int64_t ns) { return UtcTime{Duration{ns}}; }
constexpr std::int64_t to_ns(UtcTime time) { return time.time_since_epoch().count(); }

constexpr double to_seconds(Duration duration) { return static_cast<double>(duration.count()) * 1e-9; }

/// Nearest nanosecond. Valid for |seconds| below 9e9 (292 years).
inline Duration from_seconds(double seconds) {
  return Duration{static_cast<std::int64_t>(std::llround(seconds * 1e9))};
}

}  // namespace imuscope
