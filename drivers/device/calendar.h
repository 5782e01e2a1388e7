#pragma once

/// Dates as devices send them.

#include <chrono>
#include <cstdint>
#include <optional>

namespace imuscope {

/// GNSS began in 1980; nanoseconds since 1970 end in 2262. Other years are what a device sends that has no
/// date.
inline constexpr int kYearMin = 1980;
inline constexpr int kYearMax = 2261;

/// Nothing where the numbers are no date.
inline std::optional<std::int64_t> days_since_1970(int year, unsigned month, unsigned day) noexcept {
  if (year < kYearMin || year > kYearMax) return std::nullopt;
  const std::chrono::year_month_day date{std::chrono::year{year}, std::chrono::month{month},
                                         std::chrono::day{day}};
  if (!date.ok()) return std::nullopt;
  return std::chrono::sys_days{date}.time_since_epoch().count();
}

/// Whether a time of day that goes back tells a leap second: at the end of a UTC day, by less than the second
/// that was inserted. Some devices count 23:59:60, others show 23:59:59 or 00:00:00 twice; a second has
/// passed in each case.
///
/// @param time_of_day  after the step
/// @param step         from the time of day before, taken through midnight
inline bool is_leap_second(std::chrono::nanoseconds time_of_day, std::chrono::nanoseconds step) noexcept {
  using namespace std::chrono_literals;
  const bool near_midnight = time_of_day < 2s || time_of_day > 24h - 2s;
  return near_midnight && step <= 0s && step > -1s;
}

}  // namespace imuscope
