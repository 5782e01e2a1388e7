// Whole histories of clocks, held as they once were: every step of what is told of them.
#include <gtest/gtest.h>

#include <functional>

#include "sample/clock_map.h"
#include "sample/steering_line.h"
#include "sample/utc_scale.h"
#include "tests/drivers/support/sample_text.h"
#include "tests/support/recorded_answer.h"

namespace imuscope {
namespace {

using namespace std::chrono_literals;
using test::in_groups;
using test::real_text;

constexpr HostTime kWholeBegin = host_time_from_ns(5'000'000'000'000);
constexpr UtcTime kWholeUtcBegin = utc_time_from_ns(1'773'480'600'000'000'000);

/// Pseudo-random, the same everywhere: between 0 and 1.
double scatter(int k) { return static_cast<double>((k * 7919 + 104'729) % 9973) / 9973.0; }

/// A device that is sampled every `period_s`; when each sample arrives is told.
std::string mapped(const ClockMapConfig& config, int n, double period_s,
                   const std::function<double(int)>& device_s, const std::function<double(int)>& arrives_s,
                   int shown_every) {
  ClockMap map(config);
  std::string text;
  std::uint64_t restarts = 0;
  for (int k = 0; k < n; ++k) {
    const HostTime arrival = kWholeBegin + from_seconds(arrives_s(k));
    const auto device_ns = static_cast<std::int64_t>(std::llround(1e9 * device_s(k)));
    const HostTime time = map.observe(device_ns, arrival);
    const bool changed = map.restarts() != restarts;
    restarts = map.restarts();
    if (k % shown_every != 0 && !changed) continue;
    text += std::to_string(k) + ": " +
            in_groups((time - kWholeBegin).count() - from_seconds(k * period_s).count()) + " drift " +
            real_text(map.drift_ppm()) + " sd " + real_text(map.scatter_s()) + " restarts " +
            std::to_string(restarts) + '\n';
  }
  return text + "--\n";
}

TEST(SampleWhole, ClockMapsOfDevicesOfEveryKind) {
  const ClockMapConfig online;
  const auto even = [](double period_s, double ppm) {
    return [=](int k) { return k * period_s * (1.0 + 1e-6 * ppm); };
  };
  std::string text;
  text += "jitter\n" + mapped(
                           online, 4000, 0.01, even(0.01, 30.0),
                           [](int k) { return 0.01 * k + 0.003 * scatter(k) * scatter(k); }, 100);
  text += "saw-tooth\n" + mapped(
                              online, 6000, 0.01, even(0.01, -5.0),
                              [](int k) { return 0.001 * std::ceil(10.0 * k + 0.3); }, 200);
  text += "stall\n" + mapped(
                          online, 3000, 0.01, even(0.01, 10.0),
                          [](int k) {
                            return 0.01 * k + 0.0005 * scatter(k) +
                                   (k > 1000 && k < 1300 ? 0.01 * (1300 - k) : 0.0);
                          },
                          50);
  text += "late for long\n" +
          mapped(
              online, 4000, 0.01, even(0.01, 10.0),
              [](int k) { return 0.01 * k + 0.0005 * scatter(k) + (k > 1500 ? 0.0625 : 0.0); }, 50);
  text += "a little late for long\n" +
          mapped(
              online, 4000, 0.01, even(0.01, 10.0),
              [](int k) { return 0.01 * k + 0.0005 * scatter(k) + (k > 1500 ? 0.049 : 0.0); }, 100);
  text += "ever less late\n" + mapped(
                                   online, 4000, 0.01, even(0.01, 10.0),
                                   [](int k) {
                                     return 0.01 * k + 0.0005 * scatter(k) +
                                            (k > 1200 ? std::max(0.0, 0.6 - 0.0003 * (k - 1200)) : 0.0);
                                   },
                                   100);
  for (const double early_s : {0.0195, 0.0205, 0.5, 2.0}) {
    for (const int at : {900, 1100}) {
      text += "early by " + real_text(early_s) + '\n' +
              mapped(
                  online, 1600, 0.01, even(0.01, 10.0),
                  [=](int k) { return 0.01 * k + 0.0005 * scatter(k) - (k >= at ? early_s : 0.0); }, 160);
    }
  }
  text += "twice early\n" +
          mapped(
              online, 1600, 0.01, even(0.01, 0.0),
              [](int k) { return 0.01 * k - (k == 1200 || k == 1201 || k == 1300 ? 1.5 : 0.0); }, 100);
  text += "backwards\n" + mapped(
                              online, 3000, 0.01, [](int k) { return 0.01 * (k >= 1500 ? k - 1400 : k); },
                              [](int k) { return 0.01 * k; }, 150);
  text += "repeated\n" +
          mapped(
              online, 60, 0.01, [](int k) { return 0.01 * (k / 2); }, [](int k) { return 0.01 * k; }, 1);
  text += "host away\n" + mapped(
                              online, 4000, 0.01, even(0.01, 20.0),
                              [](int k) { return k > 1200 && k < 3000 ? 30.0 + 1e-5 * k : 0.01 * k; }, 100);
  text += "seldom\n" +
          mapped(
              online, 40, 5.0, even(5.0, 20.0), [](int k) { return 5.0 * k + 0.001 * scatter(k); }, 1);
  text += "warms up\n" + mapped(
                             online, 7000, 0.1, [](int k) { return 0.1 * k + 1e-8 * k * k * 0.01; },
                             [](int k) { return 0.1 * k + 0.002 * scatter(k); }, 200);
  text += "far off\n" + mapped(
                            online, 1500, 0.01, even(0.01, 350.0), [](int k) { return 0.01 * k; }, 100);
  text += "fixed\n" + mapped(
                          ClockMapConfig::fixed(kWholeBegin + 1s, 1.0001), 300, 1.0, even(1.0, 0.0),
                          [](int) { return 0.0; }, 30);
  test::expect_recorded("sample/clock_maps.txt", text, test::kSampleShare);
}

TEST(SampleWhole, ALineOfSteering) {
  SteeringLine line;
  std::string text = in_groups(to_ns(line.unsteered(kWholeBegin))) + ' ' + real_text(line.rate()) + '\n';
  for (int k = 0; k < 40; ++k) {
    line.observe(kWholeBegin + k * 10s, kWholeBegin + k * 10s - 77s + Duration{k * k * 1000}, 1e-6 * k);
    if (k % 7 == 3) line.observe(kWholeBegin + k * 10s - 1s, kWholeBegin, 1.0);
    if (k % 7 == 4) line.observe(kWholeBegin + k * 10s, kWholeBegin, 1.0);
    for (const Duration off : {Duration{-400s}, Duration{-25s}, Duration{-10s}, Duration{0s}, Duration{3s}})
      text += in_groups((line.unsteered(kWholeBegin + k * 10s + off) - kWholeBegin).count()) + ' ';
    text += real_text(line.rate()) + '\n';
  }
  test::expect_recorded("sample/steering.txt", text, test::kSampleShare);
}

std::string pulses_text(const PulseClock& clock, HostTime time) {
  return in_groups((clock.at(time) - kWholeUtcBegin).count()) + " rate " + real_text(1e6 * clock.rate()) +
         " sd " + real_text(1e6 * clock.sd_s(1s)) + ' ' + real_text(1e6 * clock.sd_s(-100s)) + ' ' +
         real_text(1e6 * clock.sd_rate()) + " jitter " + real_text(1e6 * clock.jitter_s()) +
         (clock.is_known() ? " known" : "") + (clock.has_begun() ? " begun" : "");
}

TEST(SampleWhole, PulsesThroughEveryKindOfTrouble) {
  std::string text;
  PulseClock clock;
  const auto pulse = [&](int second, double late_s) {
    const HostTime time = kWholeBegin + from_seconds(second * (1.0 + 2e-5) + late_s);
    const bool believed = clock.observe(time, kWholeUtcBegin + std::chrono::seconds(second));
    text += std::to_string(second) + (believed ? " + " : " - ") + pulses_text(clock, time) + '\n';
  };
  text += pulses_text(clock, kWholeBegin) + '\n';
  for (int k = 0; k < 70; ++k) pulse(k, 5e-6 * scatter(k));
  pulse(69, 0.0);
  pulse(71, 400e-6);
  pulse(72, 3e-6);
  pulse(73, -300e-6), pulse(74, -300e-6), pulse(75, -300e-6), pulse(76, -300e-6);
  pulse(90, -295e-6), pulse(91, -294e-6);
  pulse(92, -700e-6), pulse(93, 500e-6), pulse(94, 510e-6);
  for (int k = 95; k < 130; ++k) pulse(k, 500e-6 + 2e-3 * scatter(k));
  clock.shift(-1s);
  pulse(131, 500e-6);
  clock.steer(kWholeBegin + 140s, kWholeBegin + 60s, 1e-5);
  text += pulses_text(clock, kWholeBegin + 140s) + '\n';
  for (int k = 141; k < 150; ++k) pulse(k, 500e-6 + 3e-6 * scatter(k));
  clock.steer(kWholeBegin + 150s, kWholeBegin + 70s + 10us, -3e-4);
  for (int k = 151; k < 158; ++k) pulse(k, 500e-6 + 3e-6 * scatter(k) - 3.1e-4 * (k - 150));
  clock.forget();
  text += pulses_text(clock, kWholeBegin + 160s) + '\n';
  for (int k = 161; k < 165; ++k) pulse(k, 0.0);
  test::expect_recorded("sample/pulses.txt", text, test::kSampleShare);
}

// ---------------------------------------------------------------------------------------------------- UTC

struct Scale {
  UtcScale scale;
  std::string text;
  UtcTime utc_begin = kWholeUtcBegin;

  static HostTime host(double t_s) { return kWholeBegin + from_seconds(t_s * (1.0 - 2e-5)); }
  [[nodiscard]] UtcTime utc(double t_s) const { return utc_begin + from_seconds(t_s); }
  void tag(UtcSource source, double t_s, double late_s = 0.0, double told_off_s = 0.0) {
    scale.observe(source, host(t_s + late_s), utc(t_s + told_off_s));
  }
  void pulse(double t_s, double late_s = 0.0, double wall_off_s = 0.0) {
    scale.observe_pulse(host(t_s + late_s), utc(t_s + wall_off_s));
  }
  void tell(double t_s) {
    const TimeScale& s = scale.scale();
    const PulseState& p = s.pulses;
    text += real_text(t_s) + ": " + std::to_string(static_cast<int>(s.source)) + " t " +
            in_groups((s.time - kWholeBegin).count()) + " utc " + in_groups((s.utc - utc_begin).count()) +
            " sd " + real_text(s.sd_utc_s) + " rate " + real_text(1e6 * s.rate) + ' ' +
            real_text(1e6 * s.sd_rate) + " steps " + std::to_string(s.steps) + " leap " +
            std::to_string(s.gps_minus_utc_s) + " s " + real_text(scale.seconds_at(host(t_s)));
    if (p.is_known || p.used + p.left_out > 0) {
      text += " pulses " + std::string(p.is_known ? "+" : "-") + (p.counted_by_pc_clock ? "pc " : " ") +
              in_groups((p.time - kWholeBegin).count()) + ' ' + in_groups((p.utc - utc_begin).count()) + ' ' +
              real_text(1e6 * p.sd_utc_s) + ' ' + real_text(1e6 * p.rate) + ' ' + real_text(1e6 * p.sd_rate) +
              ' ' + real_text(1e6 * p.jitter_s) + ' ' + std::to_string(p.used) + ' ' +
              std::to_string(p.left_out) + " delays " + real_text(p.reference_delay.mean_s) + ' ' +
              real_text(p.reference_delay.sd_s) + ' ' + real_text(p.gnss_delay.mean_s) + ' ' +
              real_text(p.gnss_delay.sd_s);
    }
    text += '\n';
  }
};

TEST(SampleWhole, UtcByTagsAlone) {
  std::string text;
  {
    Scale s;
    s.tell(0.0);
    s.scale.set_pc_clock(Scale::host(0.0), s.utc(0.0) + 3s);
    s.tell(0.0);
    for (int k = 0; k < 900; ++k) {
      const double t_s = 0.1 * k;
      s.tag(UtcSource::kReference, t_s, 100e-6 * scatter(k));
      if (k % 10 == 0) s.tag(UtcSource::kGnss, t_s, 0.08);
      if (k % 60 == 0 || k < 5) s.tell(t_s);
    }
    s.scale.set_pc_clock(Scale::host(90.0), s.utc(0.0));
    s.tag(UtcSource::kReference, 90.0, 0.0, 0.5), s.tell(90.0);
    s.tag(UtcSource::kReference, 90.1), s.tell(90.1);
    for (int k = 0; k < 5; ++k)
      s.tag(UtcSource::kReference, 91.0 + 0.1 * k, 0.0, 0.5), s.tell(91.0 + 0.1 * k);
    s.tag(UtcSource::kReference, 91.2, 0.0, 0.5), s.tell(91.2);
    for (int k = 0; k < 10; ++k)
      s.tag(UtcSource::kReference, 92.0 + 0.1 * k, 0.002, 0.5), s.tell(92.0 + 0.1 * k);
    // The R-IMU falls silent, and a receiver takes over.
    for (int k = 0; k < 90; ++k) {
      s.tag(UtcSource::kGnss, 93.0 + 0.1 * k, 0.08, 0.5);
      if (k % 10 == 0 || (k > 44 && k < 56)) s.tell(93.0 + 0.1 * k);
    }
    s.scale.set_found_delay(UtcSource::kGnss, 0.07, 0.002), s.tell(102.0);
    s.scale.set_found_delay(UtcSource::kReference, 0.05, 0.001), s.tell(102.0);
    for (int k = 0; k < 5; ++k) s.tag(UtcSource::kReference, 103.0 + 0.1 * k), s.tell(103.0 + 0.1 * k);
    text += s.text;
  }
  // Leap seconds, and steps that are none.
  for (const double step_s : {-1.0, 1.0, -1.019, -1.021, -2.0}) {
    for (const double after_midnight_s : {-10.5, -9.5, 9.5, 10.5}) {
      Scale s;
      s.utc_begin = utc_time_from_ns(1'483'228'800'000'000'000) + from_seconds(after_midnight_s - 5.3);
      for (int k = 0; k < 50; ++k) s.tag(UtcSource::kReference, 0.1 * k);
      for (int k = 0; k < 6; ++k) s.tag(UtcSource::kReference, 5.0 + 0.1 * k, 0.0, step_s);
      text += real_text(step_s) + ' ';
      s.tell(5.6);
      text += s.text;
    }
  }
  test::expect_recorded("sample/utc_by_tags.txt", text, test::kSampleShare);
}

TEST(SampleWhole, UtcByPulses) {
  std::string text;
  for (const UtcSource source : {UtcSource::kNone, UtcSource::kReference, UtcSource::kGnss}) {
    for (const double wall_off_s : {0.2, -0.7}) {
      // What the PC's clock shows matters alone where nobody tells UTC.
      if (source != UtcSource::kNone && wall_off_s < 0.0) continue;
      Scale s;
      for (int k = 0; k < 60; ++k) {
        if (source != UtcSource::kNone) {
          for (int i = 0; i < 5; ++i)
            s.tag(source, k + 0.2 * i, source == UtcSource::kReference ? 0.004 : 0.12);
        }
        s.pulse(k, 20e-6 * scatter(k), wall_off_s);
        if (k % 9 == 0 || k < 6) s.tell(k + 0.9);
      }
      s.pulse(60.4), s.tell(60.4);
      s.pulse(61.0, 0.0), s.tell(61.0);
      for (int k = 0; k < 5; ++k) s.pulse(62.5 + k), s.tell(62.5 + k);
      for (int k = 0; k < 5; ++k) s.pulse(70.0 + k), s.tell(70.0 + k);
      s.scale.observe_steering(Scale::host(75.5), Scale::host(75.5) - 17s, 1e-5), s.tell(75.5);
      for (int k = 0; k < 8; ++k) s.pulse(76.0 + k), s.tell(76.0 + k);
      s.scale.observe_steering(Scale::host(84.5), Scale::host(84.5) - 17s, -2e-5), s.tell(84.5);
      // A receiver tells another second, and the pulses end.
      for (int k = 0; k < 8; ++k) s.tag(UtcSource::kGnss, 86.0 + 0.2 * k, 0.12, -1.0), s.tell(86.0 + 0.2 * k);
      s.scale.set_found_delay(UtcSource::kPulses, 0.003, 0.0005), s.tell(88.0);
      text += in_groups((s.scale.host_time_by_pulses(s.utc(88.0)) - kWholeBegin).count()) + '\n';
      s.pulse(88.0), s.tell(88.0);
      for (const double later_s : {100.0, 680.0, 687.9, 688.1, 690.0, 700.0})
        s.tag(UtcSource::kGnss, later_s, 0.12, -1.0), s.tell(later_s);
      s.scale.set_found_delay(UtcSource::kGnss, 0.03, 0.005), s.tell(700.0);
      for (int k = 0; k < 3; ++k) s.tag(UtcSource::kReference, 701.0 + k, 0.004), s.tell(701.0 + k);
      for (int k = 0; k < 3; ++k) s.pulse(705.0 + k), s.tell(705.0 + k);
      for (int k = 0; k < 3; ++k) s.pulse(715.0 + k), s.tell(715.0 + k);
      text += s.text + "--\n";
    }
  }
  test::expect_recorded("sample/utc_by_pulses.txt", text, test::kSampleShare);
}

}  // namespace
}  // namespace imuscope
