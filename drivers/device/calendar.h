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

}  // namespace imuscope
