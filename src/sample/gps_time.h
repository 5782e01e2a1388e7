#pragma once

/// GPS time, for receivers that tag with it and for people who count in it.

#include <cstdint>

#include "base/time.h"

namespace imuscope {

/// Days from 1970-01-01 to the GPS epoch, 1980-01-06.
inline constexpr std::int64_t kGpsEpochDays = 3657;

/// GPS time minus UTC in seconds, at an instant of GPS time counted from 1970-01-01. IERS Bulletin C: 13 s
/// from 1999-01-01 on, 14 from 2006, 15 from 2009, 16 from July 2012, 17 from July 2015, 18 from 2017-01-01
/// on. Instants before 1999 get 13. A leap second itself, 23:59:60, belongs to the step before: it becomes
/// the first second of the next day, as second 60 of a receiver that tells UTC does.
constexpr int gps_minus_utc_s(std::int64_t gps_since_1970_s) noexcept {
  struct Step {
    std::int64_t first_day;  ///< of UTC, since 1970
    int seconds;
  };
  constexpr std::int64_t kDay_s = 86'400;
  constexpr Step kSteps[] = {{17167, 18}, {16617, 17}, {15522, 16}, {14245, 15}, {13149, 14}};
  for (const Step& step : kSteps) {
    if (gps_since_1970_s >= step.first_day * kDay_s + step.seconds) return step.seconds;
  }
  return 13;
}

/// The same at an instant of UTC.
constexpr int gps_minus_utc_s(UtcTime utc) noexcept {
  const std::int64_t utc_s = std::chrono::floor<std::chrono::seconds>(utc).time_since_epoch().count();
  // The second that begins a day after a leap second has the new count, which GPS time reaches a second later
  // than the old one does.
  return gps_minus_utc_s(utc_s + gps_minus_utc_s(utc_s) + 1);
}

/// GPS time as navigators write it. The week counts on, without a roll-over.
struct GpsTime {
  std::int32_t week = 0;
  double tow_s = 0.0;  ///< since the week began, good to a nanosecond
};

/// @param gps_minus_utc_s  leap seconds at that instant
constexpr GpsTime gps_time(UtcTime utc, int gps_minus_utc_s) noexcept {
  constexpr std::int64_t kWeek_ns = 7LL * 86'400 * 1'000'000'000;
  const std::int64_t ns =
      to_ns(utc) + gps_minus_utc_s * 1'000'000'000LL - kGpsEpochDays * 86'400LL * 1'000'000'000LL;
  std::int64_t week = ns / kWeek_ns;
  if (ns % kWeek_ns < 0) --week;
  return {static_cast<std::int32_t>(week), static_cast<double>(ns - week * kWeek_ns) * 1e-9};
}

}  // namespace imuscope
