#include "sample/utc_scale.h"

#include <gtest/gtest.h>
#include <algorithm>
#include <cmath>
#include <random>

namespace imuscope {
namespace {

constexpr double kEpoch_s = 0.01;
const UtcTime kBegin = utc_time_from_ns(1'773'480'600'000'000'000);

HostTime host_at(double t_s, double ppm) {
  return host_time_from_ns(1'000'000'000'000) + from_seconds(t_s * (1.0 + ppm * 1e-6));
}

UtcTime utc_at(double t_s) { return kBegin + from_seconds(t_s); }

TEST(UtcScale, IntervalsAreTrueSecondsWhateverTheQuartz) {
  for (const double ppm : {-50.0, 0.0, 50.0}) {
    UtcScale scale;
    double begin_s = 0.0;
    for (int k = 0; k <= 60000; ++k) {
      const double t_s = k * kEpoch_s;
      scale.observe(UtcSource::kReference, host_at(t_s, ppm), utc_at(t_s));
      if (k == 6000) begin_s = scale.seconds_at(host_at(t_s, ppm));
    }
    EXPECT_NEAR(scale.seconds_at(host_at(600.0, ppm)) - begin_s, 540.0, 1e-6) << ppm;
    EXPECT_NEAR(scale.scale().rate, -ppm * 1e-6, 0.1 * scale.scale().sd_rate);
    EXPECT_NEAR(to_seconds(scale.scale().utc - utc_at(600.0)), 0.0, 1e-6);
  }
}

TEST(UtcScale, TicksDoNotShowInIntervalsAndTheSdHold) {
  // Tags in ticks of 100 us of a clock that is not in step with them, a quartz that warms up by 2 ppm.
  std::mt19937_64 random(4);
  std::uniform_real_distribution<double> phase(0.0, 1e-4);
  UtcScale scale;
  double before_s = 0.0;
  double worst_s = 0.0;
  double z2_rate = 0.0;
  double z2_utc = 0.0;
  int n = 0;
  for (int k = 0; k < 90000; ++k) {
    const double t_s = k * kEpoch_s;
    const double warm_s = 2e-6 * (t_s - 300.0 * (1.0 - std::exp(-t_s / 300.0)));
    const HostTime host = host_at(t_s + 20e-6 * t_s + warm_s, 0.0);
    scale.observe(UtcSource::kReference, host, utc_at(t_s + phase(random) - 0.5e-4));
    const double now_s = scale.seconds_at(host);
    if (t_s > 90.0) {
      worst_s = std::max(worst_s, std::abs(now_s - before_s - kEpoch_s));
      const double rate = -(20e-6 + 2e-6 * (1.0 - std::exp(-t_s / 300.0)));
      z2_rate += std::pow((scale.scale().rate - rate) / scale.scale().sd_rate, 2);
      z2_utc += std::pow(to_seconds(scale.scale().utc - utc_at(t_s)) / scale.scale().sd_utc_s, 2);
      ++n;
    }
    before_s = now_s;
  }
  EXPECT_LT(worst_s, 5e-6);  // of ticks of 100
  EXPECT_LT(z2_rate / n, 2.0);
  EXPECT_LT(z2_utc / n, 2.0);
  EXPECT_LT(scale.scale().sd_rate, 1e-6);
}

TEST(UtcScale, AClockMapThatSettlesIsNotTakenForTheQuartz) {
  // The map's line falls by 1 ms in the first twenty seconds; the PC's clock is right.
  UtcScale scale;
  for (int k = 0; k <= 3000; ++k) {
    const double t_s = k * kEpoch_s;
    const double late_s = 1e-3 * std::max(0.0, 1.0 - t_s / 20.0);
    scale.observe(UtcSource::kReference, host_at(t_s + late_s, 0.0), utc_at(t_s));
    if (k == 1800) {
      EXPECT_LT(std::abs(scale.scale().rate), 2.0 * scale.scale().sd_rate);
    }
  }
  EXPECT_LT(std::abs(scale.scale().rate), 2.0 * scale.scale().sd_rate);
}

TEST(UtcScale, ABacklogAtTheBeginningIsNotTakenForTheQuartz) {
  for (const int backlog : {2, 5, 18}) {
    UtcScale scale;
    for (int k = 0; k < 1000; ++k) {
      const double t_s = k * kEpoch_s;
      // What was read at once has the time of that read; a line follows that is right.
      const double host_s = k < backlog ? (backlog - 1) * kEpoch_s + 1e-5 * k : t_s;
      scale.observe(UtcSource::kReference, host_at(host_s, 20.0), utc_at(t_s));
    }
    EXPECT_NEAR(scale.scale().rate, -20e-6, 150e-6) << backlog;
    EXPECT_NEAR(to_seconds(scale.scale().utc - utc_at(9.99)), 0.0, 20e-6) << backlog;
  }
}

TEST(UtcScale, AStepOfTheTagsIsNoIntervalAndIsCounted) {
  UtcScale scale;
  double before_s = 0.0;
  for (int k = 0; k < 6000; ++k) {
    const double t_s = k * kEpoch_s;
    const double stepped_s = k < 3000 ? t_s : t_s - 1.0;  // a leap second that the device repeats
    scale.observe(UtcSource::kReference, host_at(t_s, 10.0), utc_at(stepped_s));
    const double now_s = scale.seconds_at(host_at(t_s, 10.0));
    if (k > 100) {
      EXPECT_NEAR(now_s - before_s, kEpoch_s, 1e-6) << k;
    }
    before_s = now_s;
  }
  EXPECT_EQ(scale.scale().steps, 1U);
  EXPECT_NEAR(to_seconds(scale.scale().utc - utc_at(58.99)), 0.0, 1e-4);
}

TEST(UtcScale, GpsTimeGoesOnThroughALeapSecondAndNotThroughACorrection) {
  const auto seen = [](UtcTime begin, double step_s) {
    UtcScale scale;
    for (int k = 0; k < 6000; ++k) {
      const double t_s = k * kEpoch_s;
      const double tag_s = k < 3000 ? t_s : t_s + step_s;
      scale.observe(UtcSource::kReference, host_at(t_s, 10.0), begin + from_seconds(tag_s));
    }
    return scale.scale().gps_minus_utc_s;
  };
  // 23:59:30 on a day whose leap second no table of today has, and on the last day that had one.
  EXPECT_EQ(seen(utc_time_from_ns(1'798'761'570'000'000'000), -1.0), 19);
  EXPECT_EQ(seen(utc_time_from_ns(1'798'761'570'000'000'000), 1.0), 17);
  EXPECT_EQ(seen(utc_time_from_ns(1'483'228'770'000'000'000), -1.0), 18);
  EXPECT_EQ(seen(kBegin, -1.0), 18) << "in the forenoon a receiver has corrected itself";
  EXPECT_EQ(seen(kBegin, 7200.0), 18);
}

TEST(UtcScale, ThePcsClockTellsWhatTimeItIsUntilADeviceDoes) {
  UtcScale scale;
  EXPECT_FALSE(scale.scale().at(host_at(0.0, 0.0)).is_known);
  scale.set_pc_clock(host_at(0.0, 0.0), kBegin);
  EXPECT_FALSE(scale.is_known()) << "its seconds are the host's own";
  EXPECT_EQ(scale.scale().source, UtcSource::kPcClock);
  EXPECT_TRUE(std::isnan(scale.scale().sd_utc_s));
  EXPECT_EQ(to_ns(scale.scale().at(host_at(5.0, 0.0)).utc), to_ns(utc_at(5.0)));
  EXPECT_EQ(scale.seconds_at(host_at(5.0, 0.0)) - scale.seconds_at(host_at(3.0, 0.0)), 2.0);
  scale.observe(UtcSource::kGnss, host_at(6.0, 0.0), utc_at(7.0));
  EXPECT_EQ(scale.scale().source, UtcSource::kGnss);
  EXPECT_EQ(to_ns(scale.scale().at(host_at(6.0, 0.0)).utc), to_ns(utc_at(7.0)));
  EXPECT_GE(scale.scale().sd_utc_s, 0.1) << "how long a receiver took, it does not say";
}

TEST(UtcScale, AReceiverCountsWhereTheReferenceTellsNothing) {
  UtcScale scale;
  EXPECT_FALSE(scale.is_known());
  EXPECT_NEAR(scale.seconds_at(host_at(2.0, 0.0)) - scale.seconds_at(host_at(1.0, 0.0)), 1.0, 1e-12);
  for (int k = 0; k < 3000; ++k) {
    const double t_s = 0.1 * k;
    scale.observe(UtcSource::kGnss, host_at(t_s, 30.0), utc_at(t_s));
  }
  EXPECT_EQ(scale.scale().source, UtcSource::kGnss);
  EXPECT_NEAR(scale.scale().rate, -30e-6, 1e-7);
  // From here on the reference tells, a millisecond apart; the receiver is not listened to any more.
  for (int k = 3000; k < 4000; ++k) {
    const double t_s = 0.1 * k;
    scale.observe(UtcSource::kReference, host_at(t_s, 30.0), utc_at(t_s + 1e-3));
    scale.observe(UtcSource::kGnss, host_at(t_s + 0.05, 30.0), utc_at(t_s + 0.05));
  }
  EXPECT_EQ(scale.scale().source, UtcSource::kReference);
  EXPECT_NEAR(to_seconds(scale.scale().utc - utc_at(399.9)), 1e-3, 1e-5);
}

}  // namespace
}  // namespace imuscope
