#pragma once

/// UTC of the scenario's clock.

#include <chrono>
#include <cstdint>

namespace imusim {

using Utc = std::chrono::sys_time<std::chrono::nanoseconds>;

/// GPS time is ahead of UTC by this many seconds since 2017-01-01.
inline constexpr int kGpsMinusUtc_s = 18;

/// Date and time of day of an instant.
struct UtcParts {
  int year;
  unsigned month;
  unsigned day;
  std::chrono::nanoseconds time_of_day;
};

inline UtcParts utc_parts(Utc utc) {
  const auto midnight = std::chrono::floor<std::chrono::days>(utc);
  const std::chrono::year_month_day date(midnight);
  return {static_cast<int>(date.year()), static_cast<unsigned>(date.month()),
          static_cast<unsigned>(date.day()), utc - midnight};
}

/// Instant t_s after the scenario's beginning, rounded to the nanosecond.
inline Utc utc_after(Utc begin, double t_s) {
  return begin + std::chrono::round<std::chrono::nanoseconds>(std::chrono::duration<double>(t_s));
}

}  // namespace imusim
