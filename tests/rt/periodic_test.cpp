#include "rt/periodic.h"

#include <gtest/gtest.h>
#include <algorithm>
#include <chrono>
#include <numeric>
#include <random>
#include <thread>
#include <vector>

#include "rt/host_clock.h"

namespace imuscope {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

constexpr Duration kPeriod = milliseconds(10);
const HostTime kStart = host_time_from_ns(1'000'000'000);

TEST(TickSchedule, CutsAreT0PlusKPeriodsWhateverTheWakeUp) {
  TickSchedule schedule(kStart, kPeriod);
  std::mt19937 random(1);
  for (std::int64_t k = 0; k < 1000; ++k) {
    ASSERT_EQ(schedule.deadline(), kStart + k * kPeriod);
    const Tick tick = schedule.deadline_reached(schedule.deadline() + microseconds(random() % 9999));
    ASSERT_EQ(tick.index, k);
    ASSERT_EQ(tick.cut, kStart + k * kPeriod);
    ASSERT_EQ(tick.skipped, 0);
  }
  EXPECT_EQ(schedule.statistics().ticks, 1000U);
  EXPECT_EQ(schedule.statistics().skipped, 0U);
}

TEST(TickSchedule, ALateWakeUpDeliversTheNewestDueTickAndCountsTheOthers) {
  TickSchedule schedule(kStart, kPeriod);
  const Tick tick = schedule.deadline_reached(kStart + milliseconds(35));
  EXPECT_EQ(tick.index, 3);
  EXPECT_EQ(tick.cut, kStart + 3 * kPeriod);
  EXPECT_EQ(tick.skipped, 3);
  EXPECT_EQ(tick.lateness, Duration(milliseconds(35))) << "lateness counts from the first deadline missed";
  EXPECT_EQ(schedule.statistics().skipped, 3U);
  EXPECT_EQ(schedule.deadline(), kStart + 4 * kPeriod) << "a delay must not shift or multiply later ticks";
}

TEST(TickSchedule, AWakeUpExactlyOnTheNextDeadlineDeliversThatTick) {
  TickSchedule schedule(kStart, kPeriod);
  const Tick tick = schedule.deadline_reached(kStart + kPeriod);
  EXPECT_EQ(tick.index, 1);
  EXPECT_EQ(tick.skipped, 1);
}

TEST(TickSchedule, WorkBeyondTheNextDeadlineIsOneOverrun) {
  TickSchedule schedule(kStart, kPeriod);
  (void)schedule.deadline_reached(kStart);
  schedule.finish(kStart + milliseconds(9));
  EXPECT_EQ(schedule.statistics().overruns, 0U);
  (void)schedule.deadline_reached(kStart + kPeriod);
  schedule.finish(kStart + milliseconds(57));
  EXPECT_EQ(schedule.statistics().overruns, 1U);
  const Tick tick = schedule.deadline_reached(kStart + milliseconds(57));
  EXPECT_EQ(tick.index, 5);
  EXPECT_EQ(tick.skipped, 3);
  EXPECT_EQ(schedule.statistics().ticks + schedule.statistics().skipped, 6U)
      << "ticks 0..5 are accounted for";
}

TEST(TickSchedule, TheEndOfTheWorkIsTimedFromTheCutOfTheTickDelivered) {
  TickSchedule schedule(kStart, kPeriod);
  (void)schedule.deadline_reached(kStart + milliseconds(21));
  schedule.finish(kStart + milliseconds(23));
  EXPECT_EQ(schedule.statistics().done.max(), Duration(milliseconds(3))) << "tick 2 was cut at 20 ms";
  EXPECT_EQ(schedule.statistics().done.count(), 1U);
}

TEST(TickSchedule, EveryTickIsDeliveredOrSkippedInARandomWalk) {
  TickSchedule schedule(kStart, kPeriod);
  std::mt19937 random(2);
  HostTime now = kStart;
  std::int64_t expected = 0;
  for (int i = 0; i < 10'000; ++i) {
    now = std::max(now, schedule.deadline()) + microseconds(random() % 100);
    if (random() % 50 == 0) now += microseconds(random() % 100'000);
    const Tick tick = schedule.deadline_reached(now);
    ASSERT_EQ(tick.index, expected + tick.skipped);
    ASSERT_LE(tick.cut, now);
    ASSERT_GT(tick.cut + kPeriod, now);
    expected = tick.index + 1;
    now += microseconds(random() % 12'000);
    schedule.finish(now);
  }
  const PeriodicStatistics& statistics = schedule.statistics();
  EXPECT_EQ(statistics.ticks + statistics.skipped, static_cast<std::uint64_t>(expected));
  EXPECT_GT(statistics.overruns, 0U);
}

TEST(PeriodicLoop, BeatsOnTheMonotonicClockWithoutLosingItsPhase) {
  const HostTime t0 = host_now() + milliseconds(5);
  PeriodicLoop loop(t0, milliseconds(2));
  Tick tick{};
  std::int64_t accounted = 0;
  for (int i = 0; i < 100; ++i) {
    tick = loop.wait();
    ASSERT_GE(host_now(), tick.cut) << "woken before the deadline";
    ASSERT_EQ(tick.cut, t0 + tick.index * milliseconds(2));
    accounted += 1 + tick.skipped;
  }
  EXPECT_EQ(accounted, tick.index + 1);
  EXPECT_EQ(loop.statistics().lateness.count(), 100U);
}

TEST(PeriodicLoop, WorkLongerThanThePeriodIsCountedAndNotMadeUp) {
  PeriodicLoop loop(host_now(), milliseconds(2));
  (void)loop.wait();
  std::this_thread::sleep_for(milliseconds(11));
  const Tick tick = loop.wait();
  EXPECT_GE(tick.skipped, 4);
  EXPECT_EQ(loop.statistics().overruns, 1U);
  EXPECT_EQ(loop.statistics().ticks, 2U);
}

TEST(LatenessHistogram, IsEmptyAtFirst) {
  const LatenessHistogram histogram;
  EXPECT_EQ(histogram.count(), 0U);
  EXPECT_EQ(histogram.max(), Duration::zero());
  EXPECT_EQ(histogram.quantile(0.99), Duration::zero());
}

/// Against the sorted values themselves: never below the true quantile, at most one bucket (1/8) above it.
TEST(LatenessHistogram, QuantilesAreWithinOneBucketAboveThoseOfTheSortedValues) {
  std::mt19937_64 random(3);
  std::lognormal_distribution<double> lateness(10.0, 2.0);  // median 22 us, tail to seconds
  LatenessHistogram histogram;
  std::vector<std::int64_t> sorted;
  for (int i = 0; i < 100'000; ++i) {
    const auto ns = static_cast<std::int64_t>(lateness(random));
    sorted.push_back(ns);
    histogram.add(Duration(ns));
  }
  std::sort(sorted.begin(), sorted.end());
  for (const double p : {0.001, 0.5, 0.9, 0.99, 0.999, 1.0}) {
    const auto rank = static_cast<std::size_t>(std::ceil(p * 100'000)) - 1;
    const auto exact = static_cast<double>(sorted[rank]);
    const auto found = static_cast<double>(histogram.quantile(p).count());
    EXPECT_GE(found, exact) << "p " << p;
    EXPECT_LE(found, exact * 1.125 + 1.0) << "p " << p;
  }
  EXPECT_EQ(histogram.max().count(), sorted.back());
}

TEST(LatenessHistogram, OctavesHoldEveryValueAtItsPowerOfTwo) {
  LatenessHistogram histogram;
  for (const std::int64_t ns : {0, 1000, 1024, 2047, 2048, 5000, 1'000'000}) histogram.add(Duration(ns));
  histogram.add(std::chrono::hours(1));
  const auto octaves = histogram.octaves();
  EXPECT_EQ(octaves[0], 2U) << "0 and 1000 ns";
  EXPECT_EQ(octaves[1], 2U) << "1024 and 2047 ns";
  EXPECT_EQ(octaves[2], 1U) << "2048 ns";
  EXPECT_EQ(octaves[3], 1U) << "5000 ns lie between 4096 and 8192";
  EXPECT_EQ(octaves[10], 1U) << "1 ms lies between 524288 and 1048576 ns";
  EXPECT_EQ(octaves.back(), 1U) << "what is beyond the last octave is in it";
  EXPECT_EQ(std::accumulate(octaves.begin(), octaves.end(), std::uint64_t{0}), histogram.count());
}

TEST(LatenessHistogram, TakesNegativeSmallAndEndlessDurations) {
  LatenessHistogram histogram;
  histogram.add(Duration(-5));
  histogram.add(Duration(0));
  histogram.add(Duration(7));
  EXPECT_EQ(histogram.quantile(0.5).count(), 0);
  EXPECT_EQ(histogram.quantile(1.0).count(), 7);
  histogram.add(std::chrono::hours(24));
  EXPECT_EQ(histogram.quantile(1.0), Duration(std::chrono::hours(24)))
      << "the maximum is exact beyond the last edge";
}

}  // namespace
}  // namespace imuscope
