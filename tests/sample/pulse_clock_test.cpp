/// Pulses of UTC seconds against a PC whose clock has a life of its own: written here, not by the filter's
/// model.

#include "sample/pulse_clock.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include "sample/steering_line.h"
#include "sample/utc_scale.h"

namespace imuscope {
namespace {

const UtcTime kFirstPulse = utc_time_from_ns(1'773'480'600'000'000'000);  // a whole second
const HostTime kHostAtFirstPulse = host_time_from_ns(1'000'000'000'123);

UtcTime utc_of_second(double t_s) { return kFirstPulse + from_seconds(t_s); }

/// Host seconds gone by at a true second: a quartz that is wrong, warms up, and is slewed by NTP.
struct Pc {
  double ppm = 23.0;
  double warm_ppm = 2.0;
  double slew_begin_s = 1e9;
  double slew_end_s = 1e9;
  double slew_ppm = 500.0;

  [[nodiscard]] HostTime at(double t_s) const {
    const double warm_s = warm_ppm * 1e-6 * (t_s - 600.0 * (1.0 - std::exp(-t_s / 600.0)));
    const double slewed_s = std::clamp(t_s, slew_begin_s, slew_end_s) - slew_begin_s;
    return kHostAtFirstPulse + from_seconds(t_s + ppm * 1e-6 * t_s + warm_s + slew_ppm * 1e-6 * slewed_s);
  }
};

/// Interrupts: 2 us after the pulse in the mean, one in fifty waits for a tenth of a millisecond.
class Interrupts {
 public:
  double next_s() {
    const double mean_s = std::uniform_real_distribution<double>(0.0, 1.0)(random_) < 0.02 ? 1e-4 : 2e-6;
    return std::exponential_distribution<double>(1.0 / mean_s)(random_);
  }

 private:
  std::mt19937_64 random_{7};
};

/// |error| of at() half-way between pulses, sorted, and the mean of its square over the claimed variance.
struct Score {
  std::vector<double> error_s;
  double z2 = 0.0;
  [[nodiscard]] double quantile(double share) const {
    return error_s[static_cast<std::size_t>(share * static_cast<double>(error_s.size() - 1))];
  }
};

Score run(
    const Pc& pc, int n_pulses, const std::function<bool(int)>& is_missing = [](int) { return false; }) {
  PulseClock clock;
  Interrupts interrupts;
  Score score;
  for (int k = 0; k < n_pulses; ++k) {
    if (is_missing(k)) continue;
    clock.observe(pc.at(k + interrupts.next_s()), utc_of_second(k));
    if (k < 30) continue;
    const double error_s = to_seconds(clock.at(pc.at(k + 0.5)) - utc_of_second(k + 0.5));
    score.error_s.push_back(std::abs(error_s));
    score.z2 += std::pow(error_s / clock.sd_s(pc.at(k + 0.5) - clock.last()), 2);
  }
  std::sort(score.error_s.begin(), score.error_s.end());
  score.z2 /= static_cast<double>(score.error_s.size());
  return score;
}

TEST(PulseClock, KnowsUtcToTenMicrosecondsOnAQuartzThatWarmsUp) {
  for (const double ppm : {-50.0, 0.0, 50.0}) {
    Pc pc;
    pc.ppm = ppm;
    const Score score = run(pc, 1800);
    EXPECT_LT(score.quantile(0.95), 10e-6) << ppm;
    EXPECT_LT(score.quantile(1.0), 60e-6) << ppm;
  }
}

TEST(PulseClock, FollowsNtpThatSlewsTheClock) {
  Pc pc;
  pc.slew_begin_s = 600.0;
  pc.slew_end_s = 610.0;  // 5 ms at 500 ppm
  const Score score = run(pc, 1800);
  EXPECT_LT(score.quantile(0.95), 10e-6);
}

TEST(PulseClock, WhoIsToldHowTheClockIsSteeredKnowsUtcWhileNtpSlewsIt) {
  Pc pc;
  Pc unsteered = pc;
  pc.slew_begin_s = 300.4;
  pc.slew_end_s = 310.7;
  Interrupts interrupts;
  PulseClock clock;
  // As a watcher of both clocks tells it, twenty milliseconds after each change at most.
  const auto told = [&](double t_s, double slew_ppm) {
    const double rate = to_seconds(unsteered.at(t_s + 0.01) - unsteered.at(t_s)) /
                            to_seconds(pc.at(t_s + 0.01) - pc.at(t_s)) -
                        1.0;
    EXPECT_NEAR(rate, -slew_ppm * 1e-6, 1e-6);
    clock.steer(pc.at(t_s), unsteered.at(t_s) + std::chrono::hours(20), rate);
  };
  told(-0.5, 0.0);
  double worst_s = 0.0;
  for (int k = 0; k < 600; ++k) {
    (void)clock.observe(pc.at(k + interrupts.next_s()), utc_of_second(k));
    for (int look = 1; look < 50; ++look) {
      const double t_s = k + 0.02 * look;
      if (k == 300 && look == 21) told(t_s, 500.0);
      if (k == 310 && look == 36) told(t_s, 0.0);
      if (k < 60) continue;
      worst_s = std::max(worst_s, std::abs(to_seconds(clock.at(pc.at(t_s)) - utc_of_second(t_s))));
    }
  }
  // Twenty milliseconds of 500 ppm, and what interrupts leave; without being told it is half a millisecond.
  EXPECT_LT(worst_s, 20e-6);
  EXPECT_NEAR(clock.rate(), -(pc.ppm + pc.warm_ppm * (1.0 - std::exp(-1.0))) * 1e-6, 0.3e-6);
}

TEST(SteeringLine, IsTheHostsClockWhereNothingIsKnownAndKeepsItsPieces) {
  SteeringLine line;
  const HostTime begin = kHostAtFirstPulse;
  EXPECT_EQ(line.unsteered(begin), begin);
  EXPECT_EQ(line.rate(), 0.0);
  const HostTime quartz = host_time_from_ns(5'000'000'000);
  line.observe(begin, quartz, 100e-6);
  EXPECT_EQ(line.unsteered(begin), begin) << "it counts from where the host's clock was";
  line.observe(begin + std::chrono::seconds(10),
               quartz + std::chrono::seconds(10) + std::chrono::milliseconds(1), -400e-6);
  line.observe(begin + std::chrono::seconds(5), quartz, 0.0);  // older than what is known
  EXPECT_EQ(line.rate(), -400e-6);
  const auto gained_s = [&](double t_s) {
    const HostTime time = begin + from_seconds(t_s);
    return to_seconds(line.unsteered(time) - time);
  };
  EXPECT_NEAR(gained_s(-1.0), -100e-6, 1e-8);
  EXPECT_NEAR(gained_s(4.0), 400e-6, 1e-8);
  EXPECT_NEAR(gained_s(10.0), 1e-3, 1e-8);
  EXPECT_NEAR(gained_s(12.0), 0.2e-3, 1e-8);
  for (int k = 0; k < 100; ++k)
    line.observe(begin + std::chrono::seconds(20 + k), quartz + std::chrono::seconds(20 + k), 0.0);
  EXPECT_NEAR(gained_s(119.5), 0.0, 1e-8);
  EXPECT_NEAR(gained_s(0.0), 0.0, 1e-8) << "along the oldest that is kept";
}

TEST(PulseClock, LeavesOutALateInterruptAndGoesOnThroughMissingPulses) {
  Pc pc;
  PulseClock clock;
  for (int k = 0; k < 100; ++k) ASSERT_TRUE(clock.observe(pc.at(k + 2e-6), utc_of_second(k)));
  EXPECT_FALSE(clock.observe(pc.at(100.0 + 3e-3), utc_of_second(100.0)));
  EXPECT_TRUE(clock.observe(pc.at(101.0 + 2e-6), utc_of_second(101.0)));
  EXPECT_EQ(clock.left_out(), 1U);
  EXPECT_NEAR(to_seconds(clock.at(pc.at(101.5)) - utc_of_second(101.5)), 0.0, 5e-6);
  const Score score = run(pc, 1800, [](int k) { return k % 7 < 3 || (k > 500 && k < 620); });
  EXPECT_LT(score.quantile(0.95), 10e-6);
}

TEST(PulseClock, ItsSdHolds) {
  double z2 = 0.0;
  for (const double ppm : {-40.0, 10.0, 35.0}) {
    Pc pc;
    pc.ppm = ppm;
    z2 += run(pc, 1800).z2 / 3.0;
  }
  EXPECT_LT(z2, 2.0);
  EXPECT_GT(z2, 0.05) << "an sd that is far too large is of no use";
}

/// A run whose receiver's messages come late, and with pulses.
struct Trip {
  UtcScale scale;
  Pc pc;
  Interrupts interrupts;
  double gnss_delay_s = 0.12;
  double reference_delay_s = 0.004;
  double tags_off_s = 0.0;  ///< by which all tags are wrong
  bool has_gnss = true;
  bool has_reference_tags = false;
  bool has_pulses = true;
  UtcTime wall_begin = kFirstPulse;

  /// In the order in which a run hears of it: 100 samples of the reference a second, ten solutions, a pulse
  /// that is asked for some hundredths of a second later.
  void live(int from_s, int to_s) {
    for (int k = 100 * from_s; k < 100 * to_s; ++k) {
      const double now_s = 0.01 * k;
      const auto is_due = [&](double every_s, double after_s) {
        const double phase = (now_s - after_s) / every_s;
        return now_s > after_s && std::abs(phase - std::round(phase)) * every_s < 0.005;
      };
      if (has_reference_tags)
        scale.observe(UtcSource::kReference, pc.at(now_s),
                      utc_of_second(now_s - reference_delay_s + tags_off_s));
      if (has_gnss && is_due(0.1, gnss_delay_s)) {
        const double epoch_s = 0.1 * std::round((now_s - gnss_delay_s) / 0.1);
        scale.observe(UtcSource::kGnss, pc.at(epoch_s + gnss_delay_s), utc_of_second(epoch_s + tags_off_s));
      }
      if (has_pulses && is_due(1.0, 0.06)) {
        const double stamped_s = std::round(now_s - 0.06) + interrupts.next_s();
        scale.observe_pulse(pc.at(stamped_s), wall_begin + (pc.at(stamped_s) - pc.at(0.0)));
      }
    }
  }
  [[nodiscard]] double error_s(double t_s) const {
    return to_seconds(scale.scale().at(pc.at(t_s)).utc - utc_of_second(t_s));
  }
};

TEST(UtcScaleByPulses, TakesTheSecondFromMessagesAndItsBeginningFromPulses) {
  for (const double delay_s : {0.02, 0.12, 0.45, 0.7}) {
    Trip run;
    run.gnss_delay_s = delay_s;
    run.wall_begin = kFirstPulse + std::chrono::hours(3);  // the PC's clock is not asked
    run.live(0, 120);
    const TimeScale& scale = run.scale.scale();
    EXPECT_EQ(scale.source, UtcSource::kPulses);
    EXPECT_NEAR(run.error_s(119.5), 0.0, 10e-6) << delay_s;
    EXPECT_TRUE(scale.pulses.is_known);
    EXPECT_FALSE(scale.pulses.counted_by_pc_clock);
    EXPECT_LT(scale.pulses.sd_utc_s, 10e-6);
    EXPECT_NEAR(scale.pulses.gnss_delay.mean_s, delay_s, 1e-5);
    EXPECT_GE(scale.sd_utc_s, 1e-3) << "how late the R-IMU's stream is, nobody has told";
    EXPECT_EQ(scale.steps, 0U);
    EXPECT_NEAR(1e6 * scale.rate, -run.pc.ppm, 3.0);
    // Without pulses it goes on, and messages do not bring their delay back.
    run.has_pulses = false;
    run.live(120, 180);
    EXPECT_NEAR(run.error_s(179.9), 0.0, 1e-4) << delay_s;
  }
}

TEST(UtcScaleByPulses, LeavesTheScaleToTheReferencesTagsAndMeasuresTheDelays) {
  Trip run;
  run.has_reference_tags = true;
  run.live(0, 180);
  const TimeScale& scale = run.scale.scale();
  EXPECT_EQ(scale.source, UtcSource::kReference);
  // A sample of the R-IMU is of the instant that it was measured at, not of that of the host's clock.
  EXPECT_NEAR(run.error_s(179.0 + run.reference_delay_s), -run.reference_delay_s, 20e-6);
  EXPECT_NEAR(scale.pulses.reference_delay.mean_s, run.reference_delay_s, 20e-6);
  EXPECT_NEAR(scale.pulses.gnss_delay.mean_s, run.gnss_delay_s, 20e-6);
  // The R-IMU stops telling UTC: pulses take over, without a step.
  run.has_reference_tags = false;
  run.live(180, 240);
  EXPECT_EQ(run.scale.scale().source, UtcSource::kPulses);
  EXPECT_NEAR(run.error_s(239.0 + run.reference_delay_s), -run.reference_delay_s, 50e-6);
  EXPECT_EQ(run.scale.scale().steps, 0U);
}

TEST(UtcScaleByPulses, AsksThePcsClockForTheSecondWhereNobodyElseTells) {
  Trip run;
  run.has_gnss = false;
  run.wall_begin = kFirstPulse + std::chrono::milliseconds(300);
  run.live(0, 60);
  EXPECT_EQ(run.scale.scale().source, UtcSource::kPulses);
  EXPECT_TRUE(run.scale.scale().pulses.counted_by_pc_clock);
  EXPECT_NEAR(run.error_s(59.5), 0.0, 10e-6);
  // It was wrong by a minute, as a receiver that finds its satellites tells.
  Trip wrong;
  wrong.has_gnss = false;
  wrong.wall_begin = kFirstPulse - std::chrono::seconds(60);
  wrong.live(0, 60);
  EXPECT_NEAR(wrong.error_s(59.5), -60.0, 10e-6);
  wrong.has_gnss = true;
  wrong.live(60, 120);
  EXPECT_NEAR(wrong.error_s(119.5), 0.0, 10e-6);
  EXPECT_FALSE(wrong.scale.scale().pulses.counted_by_pc_clock);
}

TEST(UtcScaleByPulses, CountsALeapSecondWithTheReceiver) {
  Trip run;
  run.live(0, 60);
  run.tags_off_s = -1.0;
  run.live(60, 90);
  EXPECT_NEAR(run.error_s(89.5), -1.0, 10e-6) << "UTC has repeated a second";
  EXPECT_EQ(run.scale.scale().steps, 1U);
}

TEST(UtcScaleByPulses, IntervalsDoNotStepWithWhoTellsUtc) {
  Trip run;
  run.has_pulses = false;
  run.live(0, 60);
  const double before_s = run.scale.seconds_at(run.pc.at(60.0));
  run.has_pulses = true;
  run.live(60, 120);
  EXPECT_NEAR(run.scale.seconds_at(run.pc.at(120.0)) - before_s, 60.0, 2e-3);
  EXPECT_EQ(run.scale.scale().steps, 0U);
}

}  // namespace
}  // namespace imuscope
