#include "service/run/pc_clock.h"

#include <gtest/gtest.h>
#include <sys/timex.h>
#include <cmath>

#include "rt/host_clock.h"

namespace imuscope {
namespace {

/// A wall clock that is set by hand beside a host clock.
struct HandClock {
  HostTime host{std::chrono::hours(5)};
  UtcTime wall = utc_time_from_ns(1'700'000'000'000'000'000);

  void pass(Duration time, double wall_ppm = 0.0) {
    host += time;
    wall += time + from_seconds(to_seconds(time) * wall_ppm * 1e-6);
  }
  [[nodiscard]] PcClockReading read() const { return {host, wall, std::chrono::microseconds(2)}; }
};

/// A run of ten minutes, looked at every 50 ms as the publisher does.
template <typename Trouble>
std::pair<PcClockRecord, int> run_with(Trouble&& trouble) {
  HandClock clock;
  PcClockLog log([&] { return clock.read(); }, [] { return std::optional<KernelClockState>(); });
  int told = 0;
  constexpr int kTurns = 12'000;
  for (int turn = 0; turn < kTurns; ++turn) {
    trouble(turn, clock);
    if (log.look(clock.host)) ++told;
  }
  return {log.record(), told};
}

constexpr Duration kTurn = std::chrono::milliseconds(50);

TEST(PcClock, AStepIsFoundWithItsSizeAndItsInstant) {
  for (const double size_s : {3600.0, -3600.0, -1.0, 0.128, 0.005}) {
    HostTime stepped{};
    const auto [record, told] = run_with([&](int turn, HandClock& clock) {
      clock.pass(kTurn);
      if (turn != 5000) return;
      stepped = clock.host;
      clock.wall += from_seconds(size_s);
    });
    ASSERT_EQ(record.steps.size(), 1U) << size_s;
    EXPECT_NEAR(record.steps[0].size_s, size_s, 1e-4);
    EXPECT_LE(record.steps[0].after, stepped);
    EXPECT_GE(record.steps[0].before, stepped);
    EXPECT_LE(record.steps[0].before - record.steps[0].after, PcClockLog::kStepPeriod + kTurn);
    EXPECT_EQ(told, 1 + 9 + 1) << "at the start, each minute, and at the step, from which minutes count anew";
  }
}

TEST(PcClock, WhatNtpSlewsIsNoStep) {
  for (const double ppm : {500.0, -500.0}) {
    const auto [record, told] = run_with([&](int, HandClock& clock) { clock.pass(kTurn, ppm); });
    EXPECT_TRUE(record.steps.empty()) << ppm;
    EXPECT_EQ(told, 10);
  }
}

TEST(PcClock, AHostThatStoodStillHasNoStep) {
  const auto [record, told] = run_with([&](int turn, HandClock& clock) {
    clock.pass(turn == 5000 ? Duration(std::chrono::minutes(2)) : kTurn, 20.0);
  });
  EXPECT_TRUE(record.steps.empty());
  EXPECT_GT(told, 5);
}

TEST(PcClock, AClockThatIsSteppedForEverFillsNoMemory) {
  const auto [record, told] = run_with([&](int, HandClock& clock) {
    clock.pass(kTurn);
    clock.wall += std::chrono::seconds(1);
  });
  EXPECT_EQ(record.steps.size(), PcClockLog::kStepsMax);
  EXPECT_GT(record.steps_left_out, 0U);
  EXPECT_GT(told, 1000);
}

TEST(PcClock, WhatTheKernelSaysIsInSecondsAndMillionths) {
  timex clock{};
  clock.status = STA_NANO;
  clock.offset = -1500;
  clock.freq = -25 * 65536 - 32768;
  clock.maxerror = 16000;
  clock.esterror = 250;
  clock.tai = 37;
  const auto told = kernel_clock_of(TIME_OK, clock);
  ASSERT_TRUE(told);
  EXPECT_EQ(told->status, STA_NANO);
  EXPECT_TRUE(told->is_synchronised);
  EXPECT_NEAR(told->offset_s, -1.5e-6, 1e-15);
  EXPECT_EQ(told->frequency_ppm, -25.5);
  EXPECT_NEAR(told->max_error_s, 0.016, 1e-12);
  EXPECT_NEAR(told->estimated_error_s, 250e-6, 1e-12);
  EXPECT_EQ(told->tai_minus_utc_s, 37);
  EXPECT_TRUE(kernel_clock_of(TIME_INS, clock)->is_synchronised) << "a leap second is announced";
  EXPECT_FALSE(kernel_clock_of(TIME_ERROR, clock)->is_synchronised);
  EXPECT_FALSE(kernel_clock_of(-1, clock)) << "the system refuses";
  clock.status = STA_UNSYNC;
  EXPECT_FALSE(kernel_clock_of(TIME_OK, clock)->is_synchronised);
  EXPECT_NEAR(kernel_clock_of(TIME_OK, clock)->offset_s, -1.5e-3, 1e-12)
      << "microseconds where it has no finer ones";
}

TEST(PcClock, TheKernelTellsItsStateAndBothClocksAreReadTogether) {
  const auto kernel = read_kernel_clock();
  if (!kernel) GTEST_SKIP() << "a sandbox around this test forbids adjtimex";
  EXPECT_LT(std::abs(kernel->frequency_ppm), 501.0);
  EXPECT_GE(kernel->max_error_s, 0.0);
  const PcClockReading reading = read_pc_clocks();
  EXPECT_LT(reading.apart, Duration(std::chrono::milliseconds(100)));
  EXPECT_NEAR(to_seconds(wall_clock_now() - reading.wall), to_seconds(host_now() - reading.host), 0.5);
}

}  // namespace
}  // namespace imuscope
