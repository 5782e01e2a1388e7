#pragma once

/// GPS time, for receivers that tag with it.

#include <cstdint>

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

}  // namespace imuscope
