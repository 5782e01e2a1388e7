#include "sample/gps_time.h"

#include <gtest/gtest.h>

namespace imuscope {
namespace {

using namespace std::chrono_literals;

UtcTime utc(int year, unsigned month, unsigned day, Duration of_day) {
  return UtcTime(std::chrono::sys_days(std::chrono::year(year) / static_cast<int>(month) /
                                       static_cast<int>(day))) +
         of_day;
}

TEST(GpsTime, WeeksAndSecondsAreThoseOfTheCalendars) {
  // 2026-03-14 is 16 869 days after 1980-01-06, a Saturday: week 2409, six days, and 18 s of leap.
  const GpsTime drive = gps_time(utc(2026, 3, 14, 9h + 30min + 250ms), 18);
  EXPECT_EQ(drive.week, 2409);
  EXPECT_DOUBLE_EQ(drive.tow_s, 6 * 86400 + 9 * 3600 + 30 * 60 + 18.25);
  // The GPS epoch itself, when both were the same, and the nanosecond before it.
  EXPECT_EQ(gps_time(utc(1980, 1, 6, 0s), 0).week, 0);
  EXPECT_EQ(gps_time(utc(1980, 1, 6, 0s) - 1ns, 0).week, -1);
  // The second roll-over of ten bits, 2019-04-06 23:59:42 UTC: the week counts on.
  EXPECT_EQ(gps_time(utc(2019, 4, 6, 23h + 59min + 42s), 18).week, 2048);
  EXPECT_EQ(gps_time(utc(2019, 4, 6, 23h + 59min + 42s), 18).tow_s, 0.0);
}

TEST(GpsTime, LeapSecondsOfAUtcBeginWithItsDay) {
  EXPECT_EQ(gps_minus_utc_s(utc(2016, 12, 31, 23h + 59min + 59s + 999ms)), 17);
  EXPECT_EQ(gps_minus_utc_s(utc(2017, 1, 1, 0s)), 18);
  EXPECT_EQ(gps_minus_utc_s(utc(2015, 6, 30, 23h + 59min + 59s)), 16);
  EXPECT_EQ(gps_minus_utc_s(utc(2015, 7, 1, 0s)), 17);
  EXPECT_EQ(gps_minus_utc_s(utc(2026, 3, 14, 9h)), 18);
}

}  // namespace
}  // namespace imuscope
