#include "service/run/utc_track.h"

#include <gtest/gtest.h>

namespace imuscope {
namespace {

constexpr HostTime kTrackBegin = host_time_from_ns(77'000'000'000);
constexpr UtcTime kTrackUtc = utc_time_from_ns(1'773'480'600'000'000'000);

TimeScale track_scale(double host_s, double utc_s, UtcSource source = UtcSource::kReference) {
  TimeScale s;
  s.source = source;
  s.time = kTrackBegin + from_seconds(host_s);
  s.utc = kTrackUtc + from_seconds(utc_s);
  s.gps_minus_utc_s = 18;
  return s;
}

double utc_at(const UtcTrack& track, double host_s) {
  const UtcStamp stamp = track.at(kTrackBegin + from_seconds(host_s));
  EXPECT_TRUE(stamp.is_known);
  return to_seconds(stamp.utc - kTrackUtc);
}

TEST(UtcTrack, KnowsNothingUntilSomebodyTells) {
  UtcTrack track;
  track.add(TimeScale{});
  EXPECT_FALSE(track.at(kTrackBegin).is_known);
  EXPECT_FALSE(track.time_of(kTrackUtc));
}

TEST(UtcTrack, FindsAnyInstantOfALongRunThoughTheQuartzWanders) {
  // 50 ppm at first, 40 ppm later: ten hours from one end the line of the other would be 0.4 s off.
  const auto utc_of = [](double host_s) {
    return host_s < 18'000.0 ? host_s * (1.0 - 50e-6)
                             : 18'000.0 * (1.0 - 50e-6) + (host_s - 18'000.0) * (1.0 - 40e-6);
  };
  UtcTrack track;
  for (int k = 0; k <= 360'000; ++k) {
    TimeScale s = track_scale(0.1 * k, utc_of(0.1 * k));
    s.rate = 0.1 * k < 18'000.0 ? -50e-6 : -40e-6;
    track.add(s);
  }
  for (const double host_s : {-5.0, 0.0, 0.35, 17'999.95, 18'000.5, 30'000.123, 36'000.0, 36'010.0}) {
    EXPECT_NEAR(utc_at(track, host_s), utc_of(host_s), 1e-5) << host_s;
    const auto back = track.time_of(kTrackUtc + from_seconds(utc_of(host_s)));
    ASSERT_TRUE(back);
    EXPECT_NEAR(to_seconds(*back - kTrackBegin), host_s, 1e-5);
  }
}

TEST(UtcTrack, WhatAReceiverToldBeforeItsDelayWasFoundIsForgotten) {
  UtcTrack track;
  for (int k = 0; k <= 200; ++k) {
    TimeScale s = track_scale(0.1 * k, 0.1 * k - (k < 100 ? 0.13 : 0.0), UtcSource::kGnss);
    s.sd_utc_s = k < 100 ? 0.1 : 0.5e-3;
    track.add(s);
  }
  EXPECT_NEAR(utc_at(track, 3.0), 3.0, 1e-9);
  EXPECT_NEAR(utc_at(track, 15.0), 15.0, 1e-9);
}

TEST(UtcTrack, ALeapSecondIsAStepAndNoSlope) {
  UtcTrack track;
  for (int k = 0; k <= 200; ++k) {
    TimeScale s = track_scale(0.1 * k, k <= 100 ? 0.1 * k : 0.1 * k - 1.0);
    s.gps_minus_utc_s = k <= 100 ? 18 : 19;
    track.add(s);
  }
  EXPECT_NEAR(utc_at(track, 9.5), 9.5, 1e-9);
  EXPECT_NEAR(utc_at(track, 12.5), 11.5, 1e-9);
  EXPECT_EQ(track.at(kTrackBegin + from_seconds(12.5)).gps_minus_utc_s, 19);
  EXPECT_EQ(track.at(kTrackBegin + from_seconds(9.5)).gps_minus_utc_s, 18);
}

TEST(UtcTrack, WhatADeviceTellsReplacesThePcsClock) {
  UtcTrack track;
  track.add(track_scale(0.0, 4.0, UtcSource::kPcClock));
  EXPECT_NEAR(utc_at(track, 1.0), 5.0, 1e-9);
  track.add(track_scale(10.0, 10.0));
  EXPECT_NEAR(utc_at(track, 1.0), 1.0, 1e-9);
}

TEST(UtcTrack, WhatPulsesTellHoldsBeforeThemInPlaceOfAReceiversMessages) {
  UtcTrack track;
  for (int i = 0; i < 5; ++i) track.add(track_scale(i, i - 0.1, UtcSource::kGnss));
  for (int i = 5; i < 10; ++i) track.add(track_scale(i, i, UtcSource::kPulses));
  EXPECT_NEAR(utc_at(track, 2.0), 2.0, 1e-9);
  EXPECT_NEAR(utc_at(track, 8.0), 8.0, 1e-9);
  // What the R-IMU's tags say of its own samples stays.
  track.add(track_scale(10.0, 10.0 - 0.004));
  track.add(track_scale(11.0, 11.0 - 0.004));
  EXPECT_NEAR(utc_at(track, 8.0), 8.0, 1e-9);
}

}  // namespace
}  // namespace imuscope
