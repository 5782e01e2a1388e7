#include "firmware_sim/io/pc_clock.h"

#include <algorithm>
#include <cmath>

namespace imusim {
namespace {

constexpr double kPpm = 1e-6;
constexpr double kRateMax_ppm = 50.0;
constexpr double kWarmUpMax_ppm = 2.0;
// NTP looks every 64 s and takes back what it finds at 100 ppm; once, 5 ms at the kernel's 500 ppm.
constexpr double kPoll_s = 64.0;
constexpr double kCorrectionSd_s = 0.3e-3;
constexpr double kCorrection_ppm = 100.0;
constexpr double kLarge_s = 5e-3;
constexpr double kLarge_ppm = 500.0;

/// How much of [begin, end) has gone by at t.
double gone_by(double t_s, double begin_s, double end_s) { return std::clamp(t_s, begin_s, end_s) - begin_s; }

}  // namespace

PcClock PcClock::drawn(Random random, double duration_s) {
  PcClock clock;
  clock.rate_ppm = random.uniform(-kRateMax_ppm, kRateMax_ppm);
  clock.warm_up_ppm = random.uniform(-kWarmUpMax_ppm, kWarmUpMax_ppm);
  const double large_s = duration_s * random.uniform(0.1, 0.9);
  const double large_ppm = random.uniform() < 0.5 ? kLarge_ppm : -kLarge_ppm;
  clock.slews.push_back({large_s, large_s + kLarge_s / (kLarge_ppm * kPpm), large_ppm});
  for (double poll_s = kPoll_s * random.uniform(); poll_s < duration_s; poll_s += kPoll_s) {
    const double offset_s = kCorrectionSd_s * random.normal();
    const double ppm = offset_s > 0.0 ? kCorrection_ppm : -kCorrection_ppm;
    clock.slews.push_back({poll_s, poll_s + std::abs(offset_s) / (kCorrection_ppm * kPpm), ppm});
  }
  return clock;
}

double PcClock::seconds_at(double t_s) const {
  double counted_s = unsteered_seconds_at(t_s);
  for (const Slew& slew : slews) counted_s += slew.ppm * kPpm * gone_by(t_s, slew.begin_s, slew.end_s);
  return counted_s;
}

double PcClock::unsteered_seconds_at(double t_s) const {
  double awake_s = t_s;
  for (const Suspend& suspend : suspends) awake_s -= gone_by(t_s, suspend.begin_s, suspend.end_s);
  double counted_s = awake_s * (1.0 + rate_ppm * kPpm);
  if (warm_up_ppm != 0.0 && t_s > 0.0)
    counted_s += warm_up_ppm * kPpm * (t_s + warm_up_s * std::expm1(-t_s / warm_up_s));
  return counted_s;
}

bool PcClock::is_asleep_at(double t_s) const {
  return std::any_of(suspends.begin(), suspends.end(),
                     [t_s](const Suspend& suspend) { return t_s >= suspend.begin_s && t_s < suspend.end_s; });
}

double PcClock::ppm_at(double t_s) const {
  double ppm = rate_ppm;
  if (t_s > 0.0) ppm -= warm_up_ppm * std::expm1(-t_s / warm_up_s);
  for (const Slew& slew : slews)
    if (t_s >= slew.begin_s && t_s < slew.end_s) ppm += slew.ppm;
  return ppm;
}

}  // namespace imusim
