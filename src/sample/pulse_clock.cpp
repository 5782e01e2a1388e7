#include "sample/pulse_clock.h"

#include <algorithm>
#include <cmath>
#include <type_traits>

namespace imuscope {
namespace {

static_assert(std::is_trivially_copyable_v<PulseClock>);

// Of an interrupt on a PC: some microseconds where nothing holds it up. What is learned is no better than the
// first and no worse than the last.
constexpr double kJitterFirst_s = 5e-6;
constexpr double kJitterMin_s = 1e-6;
constexpr double kJitterMax_s = 1e-3;
constexpr double kJitterPulses = 60.0;
// Quartzes of PCs: within 50 ppm, NTP's corrections beside, a rate that wanders by 1e-8 in a second, and a
// phase that does by 1e-8 s.
constexpr double kSlewedRateSd = 500e-6;
constexpr double kPulseRateWalk_per_sqrt_s = 1e-8;
constexpr double kPhaseWalk_s_per_sqrt_s = 1e-8;
// Further off than so many sigma a pulse is astray.
constexpr double kAstraySigmas = 5.0;

constexpr double square(double x) noexcept { return x * x; }

}  // namespace

void PulseClock::begin(HostTime time, UtcTime second) noexcept {
  last_ = time;
  origin_ = last_quartz_ = steering_.unsteered(time);
  utc_origin_ = second;
  offset_s_ = rate_ = p_both_ = 0.0;
  jitter_variance_s2_ = square(kJitterFirst_s);
  p_offset_ = jitter_variance_s2_;
  p_rate_ = square(kSlewedRateSd);
  used_ = 1;
}

double PulseClock::variance_after(double step_s) const noexcept {
  // The rate's walk of the interval moves the phase as well, by a third of its cube.
  return p_offset_ + 2.0 * step_s * p_both_ + square(step_s) * p_rate_ +
         square(kPhaseWalk_s_per_sqrt_s) * step_s +
         square(kPulseRateWalk_per_sqrt_s) * step_s * square(step_s) / 3.0;
}

void PulseClock::steer(HostTime time, HostTime unsteered, double rate) noexcept {
  // What was learned without it is of a clock that is another one.
  if (!steering_.is_known()) forget();
  steering_.observe(time, unsteered, rate);
}

void PulseClock::forget() noexcept {
  const SteeringLine steering = steering_;
  *this = {};
  steering_ = steering;
}

bool PulseClock::observe(HostTime time, UtcTime second) noexcept {
  if (used_ == 0) {
    begin(time, second);
    return true;
  }
  if (time <= last_) {
    ++left_out_;
    return false;
  }
  const HostTime quartz = steering_.unsteered(time);
  const double step_s = to_seconds(quartz - last_quartz_);
  const double predicted_s = offset_s_ + rate_ * step_s;
  const double innovation_s = to_seconds((second - utc_origin_) - (quartz - origin_)) - predicted_s;
  double p_offset = variance_after(step_s);
  double p_both = p_both_ + step_s * p_rate_ + 0.5 * square(kPulseRateWalk_per_sqrt_s) * square(step_s);
  double p_rate = p_rate_ + square(kPulseRateWalk_per_sqrt_s) * step_s;
  if (square(innovation_s) > square(kAstraySigmas) * (p_offset + jitter_variance_s2_)) {
    // No interrupt comes before its pulse: one that seems to is the clock's own doing, as is a second one in
    // a row.
    const bool goes_on = innovation_s > 0.0 || astray_s_ * innovation_s > 0.0;
    astray_s_ = innovation_s;
    if (!goes_on) {
      ++left_out_;
      return false;
    }
    // The clock's rate has changed since the pulse before the last, and its phase with it.
    p_offset += square(innovation_s);
    p_both += square(innovation_s) / step_s;
    p_rate += square(innovation_s / step_s);
  } else {
    const double learned = square(innovation_s) * jitter_variance_s2_ / (p_offset + jitter_variance_s2_);
    jitter_variance_s2_ += (learned - jitter_variance_s2_) / kJitterPulses;
    jitter_variance_s2_ = std::clamp(jitter_variance_s2_, square(kJitterMin_s), square(kJitterMax_s));
  }
  astray_s_ = 0.0;
  const double variance = p_offset + jitter_variance_s2_;
  const double gain_offset = p_offset / variance;
  const double gain_rate = p_both / variance;
  offset_s_ = predicted_s + gain_offset * innovation_s;
  rate_ += gain_rate * innovation_s;
  p_rate_ = p_rate - gain_rate * p_both;
  p_both_ = p_both - gain_offset * p_both;
  p_offset_ = p_offset - gain_offset * p_offset;
  last_ = time;
  last_quartz_ = quartz;
  ++used_;
  return true;
}

UtcTime PulseClock::at(HostTime time) const noexcept {
  const HostTime quartz = steering_.unsteered(time);
  return utc_origin_ + (quartz - origin_) +
         from_seconds(offset_s_ + rate_ * to_seconds(quartz - last_quartz_));
}

double PulseClock::rate() const noexcept {
  const double steering = steering_.rate();
  return rate_ + steering + rate_ * steering;
}

double PulseClock::sd_s(Duration after) const noexcept {
  // Interrupts are late and never early: in the mean by about as much as they scatter, which no average takes
  // out.
  return std::sqrt(variance_after(std::abs(to_seconds(after))) + jitter_variance_s2_);
}

double PulseClock::sd_rate() const noexcept { return std::sqrt(p_rate_); }

double PulseClock::jitter_s() const noexcept { return std::sqrt(jitter_variance_s2_); }

}  // namespace imuscope
