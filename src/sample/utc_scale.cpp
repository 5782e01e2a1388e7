#include "sample/utc_scale.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

#include "sample/gps_time.h"

namespace imuscope {
namespace {

static_assert(std::is_trivially_copyable_v<UtcScale>);

// One tag: ticks of 100 us at the worst, and what a clock map leaves.
constexpr double kTagSd_s = 50e-6;
// Quartzes of PCs: within 50 ppm, and a rate that wanders by 1e-8 in a second.
constexpr double kRateSd = 50e-6;
constexpr double kRateWalk_per_sqrt_s = 1e-8;
// What a clock map's line moves by: 1 ms or so while it settles, in the first minute, little later.
constexpr double kSettling_s = 60.0;
constexpr double kSettlingWalk_s_per_sqrt_s = 2e-4;
constexpr double kOffsetWalk_s_per_sqrt_s = 2e-5;
// A tag further off than this is astray; this many in a row are a step of the tags.
constexpr double kAstray_s = 0.01;
constexpr int kAstrayToStep = 3;
// A tag that is further off than so many sigma shows that the clock map's line has moved.
constexpr double kMovedSigmas = 5.0;
// The R-IMU is believed alone for so long after its last tag.
constexpr Duration kReferenceHolds = std::chrono::seconds{5};
// A receiver sends its solution some 20 to 200 ms after the epoch; how much, it does not say.
constexpr double kReceiverDelaySd_s = 0.1;
// A step of the tags by one second, this near to a midnight of UTC, is a leap second.
constexpr double kLeapTolerance_s = 0.02;
constexpr Duration kAroundMidnight = std::chrono::seconds{10};

// A pulse is believed to mark the second of whoever tells UTC by messages, which come up to so much later
// than the instants that they tell.
constexpr double kMessageDelayMax_s = 0.9;
// Pulses that are further off the line through those before are no pulses of the same seconds.
constexpr double kPulseAstray_s = 0.1;
constexpr int kMiscountedToShift = 3;
// The pulses are believed alone for so long after the last of them, and then as long as their line is better
// known than messages would tell: a quartz that warms up goes astray by a millisecond in minutes.
constexpr Duration kPulsesHold = std::chrono::minutes{10};
// The stream of an R-IMU that does not tell UTC: filters and processor of the unit, its line, an adapter.
constexpr double kStreamDelaySd_s = 0.005;
// Delays are means over so many tags.
constexpr double kDelayTags = 500.0;

void average(double value_s, StreamDelay& delay) noexcept {
  if (std::isnan(delay.mean_s)) {
    delay = {value_s, 0.0};
    return;
  }
  const double step_s = value_s - delay.mean_s;
  delay.mean_s += step_s / kDelayTags;
  delay.sd_s = std::sqrt(delay.sd_s * delay.sd_s + (step_s * step_s - delay.sd_s * delay.sd_s) / kDelayTags);
}

bool is_leap_second(double step_s, UtcTime utc) noexcept {
  const Duration since_midnight = utc - std::chrono::floor<std::chrono::days>(utc);
  const bool near_midnight =
      since_midnight < kAroundMidnight || since_midnight > std::chrono::hours{24} - kAroundMidnight;
  return near_midnight && std::abs(std::abs(step_s) - 1.0) < kLeapTolerance_s;
}

}  // namespace

void UtcScale::set_found_delay(UtcSource source, double delay_s, double sd_s) noexcept {
  found_ = {source, delay_s, sd_s};
  if (is_known()) publish(scale_.source);
}

HostTime UtcScale::host_time_by_pulses(UtcTime utc) const noexcept {
  return scale_.host_time(is_found(UtcSource::kPulses) ? utc + from_seconds(found_.delay_s) : utc);
}

/// A receiver's delay that pulses have measured stands in the scale already.
bool UtcScale::is_found(UtcSource source) const noexcept {
  if (found_.source != source) return false;
  return source == UtcSource::kPulses || std::isnan(scale_.pulses.gnss_delay.mean_s);
}

double UtcScale::offset_at(HostTime time) const noexcept {
  return offset_s_ + rate_ * to_seconds(time - last_);
}

double UtcScale::seconds_at(HostTime time) const noexcept {
  if (!is_known()) return to_seconds(time.time_since_epoch());
  return to_seconds(time - origin_) + offset_at(time);
}

void UtcScale::begin(UtcSource source, HostTime time, UtcTime utc) noexcept {
  origin_ = last_ = time;
  utc_origin_ = utc;
  scale_.gps_minus_utc_s = gps_minus_utc_s(utc);
  p_offset_ = kTagSd_s * kTagSd_s;
  p_rate_ = kRateSd * kRateSd;
  publish(source);
}

void UtcScale::set_pc_clock(HostTime time, UtcTime utc) noexcept {
  if (is_known()) return;
  scale_.source = UtcSource::kPcClock;
  scale_.time = time;
  scale_.utc = utc;
  scale_.sd_utc_s = std::numeric_limits<double>::quiet_NaN();
  scale_.gps_minus_utc_s = gps_minus_utc_s(utc);
}

void UtcScale::predict(double step_s) noexcept {
  const bool settles = to_seconds(last_ - origin_) < kSettling_s;
  const double walk = settles ? kSettlingWalk_s_per_sqrt_s : kOffsetWalk_s_per_sqrt_s;
  offset_s_ += rate_ * step_s;
  p_offset_ += 2.0 * step_s * p_both_ + step_s * step_s * p_rate_ + walk * walk * step_s;
  p_both_ += step_s * p_rate_;
  p_rate_ += kRateWalk_per_sqrt_s * kRateWalk_per_sqrt_s * step_s;
}

void UtcScale::observe(UtcSource source, HostTime time, UtcTime utc) noexcept {
  if (source == UtcSource::kReference) last_reference_ = time;
  if (!is_known()) return begin(source, time, utc);
  if (pulses_.is_known()) measure_delay(source, time, utc);
  const bool is_spare = source == UtcSource::kGnss && scale_.source == UtcSource::kReference &&
                        time - last_reference_ < kReferenceHolds;
  const bool pulses_hold = source == UtcSource::kGnss && scale_.source == UtcSource::kPulses &&
                           time - pulses_.last() < kPulsesHold;
  if (is_spare || pulses_hold || time <= last_) return;
  // What the pulses have measured of the receiver's delay holds on without them.
  if (source == UtcSource::kGnss && !std::isnan(scale_.pulses.gnss_delay.mean_s))
    utc += from_seconds(scale_.pulses.gnss_delay.mean_s - reference_delay_s());
  if (scale_.source == UtcSource::kPulses) {
    // Another one tells from here on: what lies between the two is no step of its tags.
    utc_origin_ += from_seconds(to_seconds((utc - utc_origin_) - (time - origin_)) - offset_at(time));
  }
  const double told_s = to_seconds((utc - utc_origin_) - (time - origin_));
  predict(to_seconds(time - last_));
  last_ = time;
  const double innovation_s = told_s - offset_s_;
  if (std::abs(innovation_s) > kAstray_s + 5.0 * std::sqrt(p_offset_)) {
    if (++astray_in_a_row_ >= kAstrayToStep) {
      utc_origin_ += from_seconds(innovation_s);
      if (is_leap_second(innovation_s, utc)) {
        scale_.gps_minus_utc_s += innovation_s < 0.0 ? 1 : -1;
      } else {
        scale_.gps_minus_utc_s = gps_minus_utc_s(utc);
      }
      ++scale_.steps;
      astray_in_a_row_ = 0;
    }
    return publish(scale_.source);
  }
  astray_in_a_row_ = 0;
  // What a clock map's line moves by at once, as with the backlog of a line that was opened before it was
  // read, is none of the quartz's doing: the offset follows, and the rate stays.
  const double square_s2 = innovation_s * innovation_s;
  if (square_s2 > kMovedSigmas * kMovedSigmas * (p_offset_ + kTagSd_s * kTagSd_s)) p_offset_ += square_s2;
  const double variance = p_offset_ + kTagSd_s * kTagSd_s;
  const double gain_offset = p_offset_ / variance;
  const double gain_rate = p_both_ / variance;
  offset_s_ += gain_offset * innovation_s;
  rate_ += gain_rate * innovation_s;
  p_rate_ -= gain_rate * p_both_;
  p_both_ -= gain_offset * p_both_;
  p_offset_ -= gain_offset * p_offset_;
  publish(source);
}

/// The R-IMU's samples are of so much earlier than the host's clock shows with them.
double UtcScale::reference_delay_s() const noexcept {
  const double mean_s = scale_.pulses.reference_delay.mean_s;
  return std::isnan(mean_s) ? 0.0 : mean_s;
}

/// Which second a pulse marks.
UtcTime UtcScale::second_of(HostTime time, UtcTime wall) noexcept {
  using std::chrono::seconds;
  if (pulses_.has_begun()) return std::chrono::round<seconds>(pulses_.at(time));
  scale_.pulses.counted_by_pc_clock = !is_known();
  if (!is_known()) return std::chrono::round<seconds>(wall);
  return std::chrono::floor<seconds>(scale_.at(time).utc + from_seconds(kMessageDelayMax_s));
}

void UtcScale::observe_pulse(HostTime time, UtcTime wall) noexcept {
  const UtcTime second = second_of(time, wall);
  if (pulses_.has_begun() && std::abs(to_seconds(pulses_.at(time) - second)) > kPulseAstray_s) {
    // The other edge, or pulses of something else: what was learned is of no use once they go on.
    ++scale_.pulses.left_out;
    if (++pulses_astray_in_a_row_ >= kMiscountedToShift) {
      pulses_astray_in_a_row_ = 0;
      pulses_.forget();
      scale_.pulses.is_known = false;
    }
    return;
  }
  pulses_astray_in_a_row_ = 0;
  if (!pulses_.observe(time, second)) {
    ++scale_.pulses.left_out;
    return;
  }
  if (!pulses_.is_known()) return;
  ++scale_.pulses.used;
  tell_pulses(time);
}

void UtcScale::observe_steering(HostTime time, HostTime unsteered, double rate) noexcept {
  pulses_.steer(time, unsteered, rate);
  if (pulses_.is_known()) tell_pulses(time);
}

void UtcScale::tell_pulses(HostTime time) noexcept {
  PulseState& told = scale_.pulses;
  // A pulse may be told of after the clock was steered otherwise.
  told.time = told.is_known ? std::max(told.time, time) : time;
  told.is_known = true;
  told.utc = pulses_.at(told.time);
  told.sd_utc_s = pulses_.sd_s(told.time - pulses_.last());
  told.rate = pulses_.rate();
  told.sd_rate = pulses_.sd_rate();
  told.jitter_s = pulses_.jitter_s();
  const bool reference_tells =
      scale_.source == UtcSource::kReference && time - last_reference_ < kReferenceHolds;
  if (!reference_tells) follow_pulses(time);
}

void UtcScale::follow_pulses(HostTime time) noexcept {
  if (!is_known()) begin(UtcSource::kPulses, time, pulses_.at(time) - from_seconds(reference_delay_s()));
  // Whoever asks the kernel hears of a pulse up to a tenth of a second later.
  const HostTime now = std::max(time, last_);
  const double before_s = offset_at(now);
  const double told_s = to_seconds((pulses_.at(now) - utc_origin_) - (now - origin_)) - reference_delay_s();
  if (scale_.source != UtcSource::kPulses) {
    // Messages told it so far, by their delay too late: intervals do not change with who tells UTC.
    utc_origin_ += from_seconds(told_s - before_s);
    offset_s_ = before_s;
  } else {
    offset_s_ = told_s;
  }
  last_ = now;
  rate_ = pulses_.rate();
  const Duration since = now - pulses_.last();
  p_offset_ = pulses_.sd_s(since) * pulses_.sd_s(since);
  p_rate_ = pulses_.sd_rate() * pulses_.sd_rate();
  p_both_ = 0.0;
  astray_in_a_row_ = 0;
  publish(UtcSource::kPulses);
}

/// What a tag says against the pulses: the delay of its stream, or that the seconds are miscounted.
void UtcScale::measure_delay(UtcSource source, HostTime time, UtcTime utc) noexcept {
  const double delay_s = to_seconds(pulses_.at(time) - utc);
  // A message tells an instant that has passed, by less than a second.
  const double whole_s = std::ceil(delay_s - kMessageDelayMax_s);
  if (whole_s != 0.0) {
    if (++miscounted_in_a_row_ >= kMiscountedToShift) count_seconds_anew(time, from_seconds(-whole_s), utc);
    return;
  }
  miscounted_in_a_row_ = 0;
  scale_.pulses.counted_by_pc_clock = false;
  average(delay_s,
          source == UtcSource::kReference ? scale_.pulses.reference_delay : scale_.pulses.gnss_delay);
}

/// A leap second has passed, or the PC's clock had counted wrongly.
void UtcScale::count_seconds_anew(HostTime time, Duration by, UtcTime utc) noexcept {
  miscounted_in_a_row_ = 0;
  pulses_.shift(by);
  scale_.pulses.utc += by;
  if (scale_.source != UtcSource::kPulses) return;
  utc_origin_ += by;
  scale_.gps_minus_utc_s = is_leap_second(to_seconds(by), utc)
                               ? scale_.gps_minus_utc_s + (by < Duration::zero() ? 1 : -1)
                               : gps_minus_utc_s(utc);
  ++scale_.steps;
  last_ = std::max(last_, time);
  publish(UtcSource::kPulses);
}

/// What nobody tells of the delays that stand in the scale: of the receiver's messages, and of the R-IMU's
/// stream where its own tags do not take it out.
double UtcScale::delay_sd_s(UtcSource source) const noexcept {
  if (source == UtcSource::kReference) return 0.0;
  if (is_found(source)) return found_.sd_s;
  const auto known = [](const StreamDelay& delay, double otherwise_s) {
    return std::isnan(delay.mean_s) ? otherwise_s : delay.sd_s;
  };
  const double reference_s = known(scale_.pulses.reference_delay, kStreamDelaySd_s);
  if (source == UtcSource::kPulses) return reference_s;
  return std::hypot(reference_s, known(scale_.pulses.gnss_delay, kReceiverDelaySd_s));
}

void UtcScale::publish(UtcSource source) noexcept {
  scale_.source = source;
  scale_.time = last_;
  scale_.utc = utc_origin_ + (last_ - origin_) + from_seconds(offset_s_);
  if (is_found(source)) scale_.utc += from_seconds(found_.delay_s);
  scale_.sd_utc_s = std::hypot(std::sqrt(p_offset_), delay_sd_s(source));
  scale_.rate = rate_;
  scale_.sd_rate = std::sqrt(p_rate_);
}

}  // namespace imuscope
