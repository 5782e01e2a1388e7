#pragma once

/// UTC and GPS time of the scenario's clock. GPS time runs on through a leap second; UTC then has a
/// second 60.

#include <array>
#include <chrono>
#include <cstdint>

namespace imusim {

using Utc = std::chrono::sys_time<std::chrono::nanoseconds>;
/// GPS time: as a calendar shows it, ahead of UTC.
using Gps = std::chrono::local_time<std::chrono::nanoseconds>;

/// The first day with so many seconds between GPS time and UTC: each follows a leap second (IERS Bulletin C).
struct LeapStep {
  std::chrono::year_month_day first_day;
  std::chrono::seconds gps_minus_utc;
};
inline constexpr std::array<LeapStep, 6> kLeapSteps{{
    {std::chrono::year{1999} / 1 / 1, std::chrono::seconds{13}},
    {std::chrono::year{2006} / 1 / 1, std::chrono::seconds{14}},
    {std::chrono::year{2009} / 1 / 1, std::chrono::seconds{15}},
    {std::chrono::year{2012} / 7 / 1, std::chrono::seconds{16}},
    {std::chrono::year{2015} / 7 / 1, std::chrono::seconds{17}},
    {std::chrono::year{2017} / 1 / 1, std::chrono::seconds{18}},
}};

inline std::chrono::seconds gps_minus_utc(Utc utc) {
  std::chrono::seconds difference = kLeapSteps.front().gps_minus_utc;
  for (const LeapStep& step : kLeapSteps)
    if (utc >= std::chrono::sys_days(step.first_day)) difference = step.gps_minus_utc;
  return difference;
}

inline Gps gps_of(Utc utc) { return Gps(utc.time_since_epoch() + gps_minus_utc(utc)); }

/// Instant t_s after the scenario's beginning, rounded to the nanosecond.
inline Gps gps_after(Utc begin, double t_s) {
  return gps_of(begin) + std::chrono::round<std::chrono::nanoseconds>(std::chrono::duration<double>(t_s));
}

/// Date and time of day of an instant.
struct CalendarTime {
  int year;
  unsigned month;
  unsigned day;
  std::chrono::nanoseconds time_of_day;  ///< 24 h and more in a leap second
};

template <typename Clock>
CalendarTime calendar_time(std::chrono::time_point<Clock, std::chrono::nanoseconds> instant) {
  const auto midnight = std::chrono::floor<std::chrono::days>(instant);
  const std::chrono::year_month_day date(midnight);
  return {static_cast<int>(date.year()), static_cast<unsigned>(date.month()),
          static_cast<unsigned>(date.day()), instant - midnight};
}

/// The instant by a clock that shows 23:59:59 twice in place of a second 60, as Linux does.
inline Utc utc_without_leap_second(Gps gps) {
  std::chrono::seconds difference = kLeapSteps.front().gps_minus_utc;
  for (const LeapStep& step : kLeapSteps) {
    const Gps inserted(std::chrono::local_days(step.first_day) + step.gps_minus_utc -
                       std::chrono::seconds(1));
    if (gps >= inserted) difference = step.gps_minus_utc;
  }
  return Utc(gps.time_since_epoch() - difference);
}

/// UTC with a second 60.
inline CalendarTime utc_time(Gps gps) {
  const Utc utc = utc_without_leap_second(gps);
  CalendarTime time = calendar_time(utc);
  if (gps_of(utc) != gps) time.time_of_day += std::chrono::seconds(1);
  return time;
}

}  // namespace imusim
