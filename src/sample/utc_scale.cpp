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
// The R-IMU is believed alone for so long after its last tag.
constexpr Duration kReferenceHolds = std::chrono::seconds{5};
// A receiver sends its solution some 20 to 200 ms after the epoch; how much, it does not say.
constexpr double kReceiverDelaySd_s = 0.1;
// A step of the tags by one second, this near to a midnight of UTC, is a leap second.
constexpr double kLeapTolerance_s = 0.02;
constexpr Duration kAroundMidnight = std::chrono::seconds{10};

bool is_leap_second(double step_s, UtcTime utc) noexcept {
  const Duration since_midnight = utc - std::chrono::floor<std::chrono::days>(utc);
  const bool near_midnight =
      since_midnight < kAroundMidnight || since_midnight > std::chrono::hours{24} - kAroundMidnight;
  return near_midnight && std::abs(std::abs(step_s) - 1.0) < kLeapTolerance_s;
}

}  // namespace

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
  const bool is_spare = source == UtcSource::kGnss && scale_.source == UtcSource::kReference &&
                        time - last_reference_ < kReferenceHolds;
  if (is_spare || time <= last_) return;
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

void UtcScale::publish(UtcSource source) noexcept {
  scale_.source = source;
  scale_.time = last_;
  scale_.utc = utc_origin_ + (last_ - origin_) + from_seconds(offset_s_);
  scale_.sd_utc_s = std::hypot(std::sqrt(p_offset_), source == UtcSource::kGnss ? kReceiverDelaySd_s : 0.0);
  scale_.rate = rate_;
  scale_.sd_rate = std::sqrt(p_rate_);
}

}  // namespace imuscope
