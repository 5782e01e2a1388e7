#include "sample/clock_map.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <random>
#include <vector>

namespace imuscope {
namespace {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using std::chrono::seconds;

constexpr Duration kPeriod = milliseconds{10};
constexpr double kPeriod_s = 0.01;
constexpr double kStart_s = 1000.0;

HostTime host_at(double s) { return HostTime{from_seconds(kStart_s + s)}; }

/// What a map made of a stream: its error against the truth at each sample.
struct Mapped {
  std::vector<double> error_s;
  double largest_step_back_s = 0.0;

  void add(HostTime mapped, HostTime truth) {
    if (!error_s.empty()) largest_step_back_s = std::max(largest_step_back_s, to_seconds(last - mapped));
    last = mapped;
    error_s.push_back(to_seconds(mapped - truth));
  }
  [[nodiscard]] double scatter_s(double from_s) const {
    double n = 0.0;
    double sum = 0.0;
    double sum_of_squares = 0.0;
    for (auto i = static_cast<std::size_t>(from_s / kPeriod_s); i < error_s.size(); ++i) {
      n += 1.0;
      sum += error_s[i];
      sum_of_squares += error_s[i] * error_s[i];
    }
    return std::sqrt(std::max(0.0, sum_of_squares / n - sum / n * (sum / n)));
  }
  HostTime last{};
};

/// The way of a 100 Hz stream through an FTDI adapter at 115200 baud: bytes wait until 62 are together or the
/// latency timer (16 ms) ends, then for the next 1 ms USB frame.
class Ftdi {
 public:
  Ftdi(std::size_t frame_size, double usb_phase_s) : frame_size_(frame_size), usb_phase_s_(usb_phase_s) {}

  /// @param true_time  of sample k, host seconds
  /// @return latest possible time of each frame's first byte, by back-dating its read
  std::vector<double> first_bytes(std::size_t n, const std::function<double(std::size_t)>& true_time) {
    bounds_.assign(n, std::numeric_limits<double>::infinity());
    for (std::size_t k = 0; k < n; ++k) {
      for (std::size_t b = 0; b < frame_size_; ++b)
        take(k, b, true_time(k) + kByte_s * static_cast<double>(b + 1));
    }
    flush(timer_s_ + kTimer_s);
    return bounds_;
  }

 private:
  static constexpr double kByte_s = 10.0 / 115200.0;
  static constexpr double kTimer_s = 0.016;
  static constexpr double kUsbFrame_s = 0.001;
  static constexpr std::size_t kBlock = 62;
  struct Byte {
    std::size_t frame;
    std::size_t index;
  };

  void take(std::size_t frame, std::size_t index, double at_s) {
    while (at_s > timer_s_ + kTimer_s) {
      timer_s_ += kTimer_s;
      flush(timer_s_);
    }
    waiting_.push_back({frame, index});
    if (waiting_.size() < kBlock) return;
    flush(at_s);
    timer_s_ = at_s;
  }
  void flush(double at_s) {
    const double arrival_s = std::ceil((at_s - usb_phase_s_) / kUsbFrame_s) * kUsbFrame_s + usb_phase_s_;
    for (std::size_t i = 0; i < waiting_.size(); ++i) {
      if (waiting_[i].index != 0) continue;
      bounds_[waiting_[i].frame] = arrival_s - kByte_s * static_cast<double>(waiting_.size() - i);
    }
    waiting_.clear();
  }

  std::size_t frame_size_;
  double usb_phase_s_;
  double timer_s_ = 0.0;
  std::vector<Byte> waiting_;
  std::vector<double> bounds_;
};

Mapped through_ftdi(double skew, std::size_t frame_size, double usb_phase_s, double duration_s) {
  const auto n = static_cast<std::size_t>(duration_s / kPeriod_s);
  const auto truth = [skew](std::size_t k) { return static_cast<double>(k) * kPeriod_s * (1.0 + skew); };
  const auto bounds = Ftdi(frame_size, usb_phase_s).first_bytes(n, truth);
  ClockMap map;
  Mapped mapped;
  for (std::size_t k = 0; k < n; ++k) {
    mapped.add(map.observe(kPeriod.count() * static_cast<std::int64_t>(k), host_at(bounds[k])),
               host_at(truth(k)));
  }
  EXPECT_EQ(map.restarts(), 0U);
  return mapped;
}

// Frame sizes: MTx data as it is asked for by default (43), with a quaternion (59), and three that fall into
// step with the adapter's blocks and timer, so that the beat against the USB frames is all there is to see.
constexpr std::size_t kFrameSizes[] = {31, 41, 43, 59, 62};

/// Worst scatter from 60 s on over signs of the skew, frame sizes and phases of the USB frames.
double worst_scatter_s(double skew_magnitude, double duration_s) {
  double worst_s = 0.0;
  for (const double skew : {skew_magnitude, -skew_magnitude}) {
    for (const std::size_t size : kFrameSizes) {
      for (const double phase_s : {0.1e-3, 0.45e-3, 0.8e-3}) {
        const Mapped mapped = through_ftdi(skew, size, phase_s, duration_s);
        worst_s = std::max(worst_s, mapped.scatter_s(60.0));
        EXPECT_EQ(mapped.largest_step_back_s, 0.0) << skew << " " << size << " " << phase_s;
      }
    }
  }
  std::printf("clock map behind an FTDI adapter at %.0f ppm: scatter at most %.1f us (30 streams)\n",
              skew_magnitude * 1e6, worst_s * 1e6);
  return worst_s;
}

// Of every second interval the earliest frame is 0.4 ms late: 0.2 ms about the mean, whatever else is late.
TEST(ClockMap, ScatterIsThatOfTheEarliestFrames) {
  ClockMap map;
  EXPECT_TRUE(std::isnan(map.scatter_s()));
  constexpr double kSkew = 20e-6;
  constexpr int kSamplesPerInterval = 200;
  constexpr int kIntervals = 60;
  for (int k = 0; k < kIntervals * kSamplesPerInterval; ++k) {
    const int interval = k / kSamplesPerInterval;
    const bool earliest = k % kSamplesPerInterval == kSamplesPerInterval / 2;
    const double delay_s = interval % 2 * 0.4e-3 + (earliest ? 0.0 : 5e-3);
    (void)map.observe(k * kPeriod.count(), host_at(k * kPeriod_s * (1.0 + kSkew) + delay_s));
  }
  // Of the 59 closed intervals 29 are late, and which ones tells nothing of the rate: sd over 58 degrees of freedom.
  EXPECT_NEAR(map.scatter_s(), 0.4e-3 * std::sqrt(29.0 * 30.0 / (59.0 * 58.0)), 1e-8);
  EXPECT_NEAR(map.drift_ppm(), -20.0, 0.001);
  map.restart();
  (void)map.observe(0, host_at(0.0));
  EXPECT_TRUE(std::isnan(map.scatter_s()));
}

TEST(ClockMap, ScattersLessThanAHundredMicrosecondsBehindAnFtdiAtAHundredPpm) {
  EXPECT_LT(worst_scatter_s(100e-6, 600.0), 100e-6);
}

TEST(ClockMap, ScattersLessThanThreeHundredMicrosecondsBehindAnFtdiAtFivePpm) {
  EXPECT_LT(worst_scatter_s(5e-6, 660.0), 300e-6);
}

TEST(ClockMap, BehindAnFtdiStallsBurstsAndARestartLeaveNoTrace) {
  constexpr double kSkew = 100e-6;
  constexpr std::size_t kSamples = 60000;
  constexpr std::size_t kRestart = 30000;
  const auto truth_s = [](std::size_t k) { return static_cast<double>(k) * kPeriod_s * (1.0 + kSkew); };
  std::vector<double> bounds = Ftdi(43, 0.3e-3).first_bytes(kSamples, truth_s);
  for (std::size_t k = 0; k < kSamples; ++k) {
    const double t_s = truth_s(k);
    // Three seconds without a read; later only one read every half second.
    if (t_s > 120.0 && t_s < 123.0) bounds[k] = 123.0;
    if (t_s > 150.0 && t_s < 170.0) bounds[k] = std::ceil(t_s * 2.0) / 2.0;
  }
  ClockMap map;
  Mapped before;
  Mapped after;
  for (std::size_t k = 0; k < kSamples; ++k) {
    const auto counted = static_cast<std::int64_t>(k < kRestart ? k : k - kRestart);
    Mapped& mapped = k < kRestart ? before : after;
    mapped.add(map.observe(kPeriod.count() * counted, host_at(bounds[k])), host_at(truth_s(k)));
  }
  EXPECT_EQ(map.restarts(), 1U);
  EXPECT_LT(before.scatter_s(60.0), 100e-6);
  EXPECT_LT(after.scatter_s(60.0), 100e-6);
  EXPECT_EQ(before.largest_step_back_s + after.largest_step_back_s, 0.0);
}

/// Feeds a map with samples whose delays come from a function of the sample's number.
Mapped with_delays(std::size_t n, double skew, const std::function<double(std::size_t)>& delay_s,
                   ClockMap& map) {
  Mapped mapped;
  for (std::size_t k = 0; k < n; ++k) {
    const double truth_s = static_cast<double>(k) * kPeriod_s * (1.0 + skew);
    mapped.add(map.observe(kPeriod.count() * static_cast<std::int64_t>(k), host_at(truth_s + delay_s(k))),
               host_at(truth_s));
  }
  return mapped;
}

TEST(ClockMap, FindsTheRateOfTheDevicesClock) {
  std::mt19937_64 random(5);
  std::exponential_distribution<double> delay(1.0 / 0.5e-3);
  for (const double ppm : {-80.0, 0.0, 30.0}) {
    ClockMap map;
    with_delays(
        30000, ppm * 1e-6, [&](std::size_t) { return delay(random); }, map);
    // The lowest of 200 delays of 0.5 ms mean is 2.5 us; over 300 s that is 0.01 ppm.
    EXPECT_NEAR(map.drift_ppm(), -ppm, 0.1);
  }
}

TEST(ClockMap, StallsAndBurstsMoveItByNothing) {
  // Every minute the host is away for 3 s: all that came meanwhile arrives at once at the end.
  const auto stalled = [](std::size_t k) {
    const double in_minute_s = std::fmod(static_cast<double>(k) * kPeriod_s, 60.0);
    return in_minute_s > 30.0 && in_minute_s < 33.0 ? 33.0 - in_minute_s : 0.0;
  };
  ClockMap map;
  const Mapped mapped = with_delays(60000, 20e-6, stalled, map);
  EXPECT_EQ(map.restarts(), 0U);
  EXPECT_LT(mapped.scatter_s(60.0), 2e-6);
}

/// Every five minutes the host is away for so long; then what waited comes at once, or catches up at
/// `drain` times the rate at which it was made.
struct Stall {
  double away_s;
  double drain;
};
class ClockMapStall : public testing::TestWithParam<Stall> {};

TEST_P(ClockMapStall, OfAnyLengthThatLosesNothingLeavesTheClockAlone) {
  const Stall stall = GetParam();
  const auto stalled = [&](std::size_t k) {
    const double begun_s = std::fmod(static_cast<double>(k) * kPeriod_s, 300.0) - 30.0;
    if (begun_s < 0.0) return 0.0;
    // Sample k leaves the queue when the host is back and all before it have gone.
    return std::max(0.0, stall.away_s + begun_s / stall.drain - begun_s);
  };
  ClockMap map;
  const Mapped mapped = with_delays(120000, 20e-6, stalled, map);
  EXPECT_EQ(map.restarts(), 0U);
  EXPECT_LT(mapped.scatter_s(60.0), 2e-6);
}

INSTANTIATE_TEST_SUITE_P(Lengths, ClockMapStall,
                         testing::Values(Stall{5.0, 1e6}, Stall{11.0, 1e6}, Stall{15.0, 1e6},
                                         Stall{60.0, 1e6}, Stall{120.0, 1e6}, Stall{15.0, 3.0},
                                         Stall{60.0, 3.0}, Stall{60.0, 1.3}),
                         [](const auto& stall) {
                           return "Away" + std::to_string(static_cast<int>(stall.param.away_s)) + "sDrain" +
                                  std::to_string(static_cast<int>(10.0 * std::min(stall.param.drain, 99.9)));
                         });

TEST(ClockMap, ABacklogBeforeTheFirstReadIsNoJump) {
  // A receiver at 10 Hz had been sending for 30 s when its line was opened.
  constexpr double kFix_s = 0.1;
  ClockMap map;
  double error_s = 0.0;
  for (int k = 0; k < 1500; ++k) {
    const double truth_s = k * kFix_s;
    error_s = to_seconds(map.observe(from_seconds(truth_s).count(), host_at(std::max(30.0, truth_s))) -
                         host_at(truth_s));
  }
  EXPECT_EQ(map.restarts(), 0U);
  EXPECT_NEAR(error_s, 0.0, 1e-4);
}

TEST(ClockMap, ADeviceThatStoodStillDuringAStallIsStillFound) {
  // The host is away for 15 s; the device's clock lost two of them.
  ClockMap map;
  double error_s = 0.0;
  for (int k = 0; k < 9000; ++k) {
    const double truth_s = k * kPeriod_s;
    const bool in_stall = truth_s > 30.0 && truth_s < 45.0;
    const double device_s = truth_s - (truth_s > 40.0 ? 2.0 : 0.0);
    const HostTime arrival = host_at(in_stall ? 45.0 : truth_s);
    if (truth_s > 40.0 && truth_s <= 42.0) continue;
    error_s = to_seconds(map.observe(from_seconds(device_s).count(), arrival) - host_at(truth_s));
  }
  EXPECT_EQ(map.restarts(), 1U);
  EXPECT_NEAR(error_s, 0.0, 1e-4);
}

TEST(ClockMap, FollowsACrystalThatWarmsUp) {
  // 10 ppm in all, with a time constant of 200 s.
  std::mt19937_64 random(6);
  std::uniform_real_distribution<double> delay(0.0, 1e-3);
  ClockMap map;
  Mapped mapped;
  for (int k = 0; k < 120000; ++k) {
    const double device_s = k * kPeriod_s;
    const double truth_s = device_s + 10e-6 * 200.0 * (1.0 - std::exp(-device_s / 200.0));
    mapped.add(map.observe(kPeriod.count() * k, host_at(truth_s + delay(random))), host_at(truth_s));
  }
  EXPECT_LT(mapped.scatter_s(60.0), 50e-6);
  EXPECT_EQ(mapped.largest_step_back_s, 0.0);
}

TEST(ClockMap, NeverStepsBackUnderAnyDelays) {
  std::mt19937_64 random(8);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  for (int run = 0; run < 20; ++run) {
    ClockMap map;
    const Mapped mapped = with_delays(
        5000, 200e-6 * (uniform(random) - 0.5),
        [&](std::size_t) { return std::pow(10.0, -5.0 + 5.5 * uniform(random)); }, map);
    ASSERT_EQ(mapped.largest_step_back_s, 0.0) << run;
  }
}

TEST(ClockMap, ADeviceThatRestartsBeginsAnewAndItsTimeGoesOn) {
  ClockMap map;
  const auto none = [](std::size_t) { return 0.0; };
  with_delays(10000, 0.0, none, map);
  HostTime last = map.observe(kPeriod.count() * 10000, host_at(100.0));
  for (int k = 0; k < 1000; ++k) {  // counts from 0 again, two seconds later
    const HostTime truth = host_at(102.0 + k * kPeriod_s);
    const HostTime mapped = map.observe(kPeriod.count() * k, truth);
    ASSERT_GT(mapped, last);
    ASSERT_NEAR(to_seconds(mapped - truth), 0.0, 1e-6) << k;
    last = mapped;
  }
  EXPECT_EQ(map.restarts(), 1U);
}

TEST(ClockMap, AJumpOfTheDevicesClockIsFoundByItself) {
  // The device's count jumps ahead, falls back, or stands still for a while.
  struct Jump {
    double device_s;
    double host_s;
  };
  for (const Jump jump : {Jump{2.0, 0.0}, Jump{-0.5, 0.0}, Jump{0.0, 0.2}}) {
    ClockMap map;
    HostTime last{};
    double error_s = 0.0;
    for (int k = 0; k < 6000; ++k) {
      const bool after = k >= 3000;
      const double device_s = k * kPeriod_s + (after ? jump.device_s : 0.0);
      const HostTime truth = host_at(k * kPeriod_s + (after ? jump.host_s : 0.0));
      const HostTime mapped = map.observe(from_seconds(device_s).count(), truth);
      ASSERT_TRUE(k == 0 || mapped > last);
      last = mapped;
      error_s = to_seconds(mapped - truth);
    }
    EXPECT_EQ(map.restarts(), 1U) << jump.device_s << " " << jump.host_s;
    EXPECT_NEAR(error_s, 0.0, 1e-4) << jump.device_s << " " << jump.host_s;
  }
}

TEST(ClockMap, OneFalselyEarlyStampIsNotBelieved) {
  ClockMap map;
  const Mapped mapped = with_delays(
      10000, 0.0, [](std::size_t k) { return k == 5000 ? -0.2 : 0.0; }, map);
  EXPECT_EQ(map.restarts(), 0U);
  EXPECT_LT(mapped.scatter_s(40.0), 1e-6);
}

TEST(ClockMap, OneDeviceTimeFarAheadIsMappedToItsArrival) {
  ClockMap map;
  std::int64_t k = 0;
  for (; k < 2000; ++k) (void)map.observe(k * kPeriod.count(), host_at(static_cast<double>(k) * kPeriod_s));
  const HostTime arrival = host_at(static_cast<double>(k) * kPeriod_s);
  EXPECT_EQ(map.observe(k * kPeriod.count() + Duration(seconds{100}).count(), arrival), arrival);
  ++k;
  const HostTime next = host_at(static_cast<double>(k) * kPeriod_s);
  EXPECT_EQ(map.observe(k * kPeriod.count(), next), next);
}

TEST(ClockMap, AfterALongSilenceItIsRightAtOnce) {
  ClockMap map;
  constexpr double kSkew = 40e-6;
  with_delays(
      30000, kSkew, [](std::size_t) { return 0.0; }, map);
  const double later_s = 300.0 + 3600.0;
  const HostTime truth = host_at(later_s * (1.0 + kSkew));
  EXPECT_NEAR(to_seconds(map.observe(from_seconds(later_s).count(), truth) - truth), 0.0, 1e-4);
}

TEST(ClockMap, TheSameInstantIsMappedToTheSameTime) {
  ClockMap map;
  const HostTime first = map.observe(1000, host_at(1.0));
  EXPECT_EQ(map.observe(1000, host_at(1.5)), first);
  EXPECT_EQ(map.restarts(), 0U);
}

/// A clock that is fast until device time `turn_s` and slow after it, 60 ppm each, seen once in each interval of two
/// seconds of device time but for the one that holds the turn, where it is seen at the turn: in ppm, after so many intervals.
double drift_of_a_clock_that_turns_ppm(double turn_s, int intervals) {
  constexpr double kRate = 60e-6;
  constexpr double kInterval_s = 2.0;
  ClockMap map;
  (void)map.observe(0, host_at(1.0));  // late: no point of the envelope
  for (int i = 0; i <= intervals; ++i) {
    const bool holds_turn = std::floor(turn_s / kInterval_s) == i;
    const double device_s = holds_turn ? turn_s : kInterval_s * i + 1.9;
    (void)map.observe(std::llround(device_s * 1e9),
                      host_at(0.9 + device_s + kRate * std::abs(device_s - turn_s)));
  }
  EXPECT_EQ(map.restarts(), 0U);
  return map.drift_ppm();
}

// The turn is a corner of the envelope: its time against the mean of all decides which side the rate is of.
TEST(ClockMap, TheRateIsThatOfTheEnvelopeAtTheMeanTime) {
  // Intervals 0 to 40: seen at 1.9 to 81.9 s, in the mean at 41.9 s.
  EXPECT_LT(drift_of_a_clock_that_turns_ppm(41.89, 41), -30.0);
  EXPECT_GT(drift_of_a_clock_that_turns_ppm(41.91, 41), 30.0);
  // More intervals than are kept, 1 to 256: in the mean at 258.896 s.
  EXPECT_LT(drift_of_a_clock_that_turns_ppm(258.89, 257), -30.0);
  EXPECT_GT(drift_of_a_clock_that_turns_ppm(258.905, 257), 30.0);
}

TEST(ClockMap, TheSameObservationsGiveTheSameBits) {
  const auto run = [] {
    std::mt19937_64 random(9);
    std::exponential_distribution<double> delay(500.0);
    ClockMap map;
    std::vector<std::int64_t> mapped;
    for (int k = 0; k < 20000; ++k) {
      mapped.push_back(to_ns(map.observe(kPeriod.count() * k, host_at(k * kPeriod_s + delay(random)))));
    }
    return mapped;
  };
  EXPECT_EQ(run(), run());
}

TEST(ClockMap, AFixedClockIsOriginPlusRatioTimesDeviceTimeToTheNanosecond) {
  const HostTime origin = host_at(5.0);
  ClockMap map(ClockMapConfig::fixed(origin, 1.0 - 25e-6));
  EXPECT_TRUE(map.is_fixed());
  constexpr std::int64_t kDay_ns = 86'400'000'000'000;
  EXPECT_EQ(map.observe(kDay_ns, HostTime{}) - origin, nanoseconds{kDay_ns - 2'160'000'000});
  EXPECT_EQ(map.observe(0, host_at(1e6)), origin);
  EXPECT_NEAR(map.drift_ppm(), 25.0, 1e-3);
}

}  // namespace
}  // namespace imuscope
