#pragma once

/// The host's clock against UTC by pulses that mark its seconds (PPS): to microseconds, where messages tell
/// to a hundred milliseconds. Which second a pulse marks somebody else says.
///
/// Kalman filter of two states, UTC minus host time and its rate. A pulse is stamped late where an interrupt
/// had to wait: one that lies off by itself is left out, two in a row are the clock's own. NTP slews
/// CLOCK_MONOTONIC, by up to 500 ppm from one moment to the next; the next pulse is too late to tell of it,
/// and whoever tells how the clock is steered (steer()) tells it at once: the line is one over the quartz then.
/// The pulses' jitter is learned from their scatter.
///
/// Deterministic: a function of the observations alone.

#include <cstdint>

#include "base/time.h"
#include "sample/steering_line.h"

namespace imuscope {

/// Core: no allocation, noexcept. Not thread-safe; trivially copyable.
class PulseClock {
 public:
  /// A pulse.
  /// @param time    host time at which it was stamped; later than the one before, or it is left out
  /// @param second  whole second of UTC that it marks
  /// @return whether it was believed
  bool observe(HostTime time, UtcTime second) noexcept;

  /// The host's clock is steered otherwise from here on: see SteeringLine.
  void steer(HostTime time, HostTime unsteered, double rate) noexcept;

  /// The seconds were miscounted, or a leap second passed: UTC is later by so much.
  void shift(Duration by) noexcept { utc_origin_ += by; }
  /// Begins anew with the next pulse.
  void forget() noexcept;

  /// Enough pulses have come for `at()` and sd_s() to hold.
  [[nodiscard]] bool is_known() const noexcept { return used_ >= kPulsesToKnow; }
  [[nodiscard]] bool has_begun() const noexcept { return used_ > 0; }

  /// Any instant near the last pulse.
  [[nodiscard]] UtcTime at(HostTime time) const noexcept;
  /// Standard deviation of at(last pulse), and of at() so long after it.
  [[nodiscard]] double sd_s(Duration after = {}) const noexcept;
  [[nodiscard]] double rate() const noexcept;  ///< UTC seconds per host second, minus 1
  [[nodiscard]] double sd_rate() const noexcept;
  [[nodiscard]] HostTime last() const noexcept { return last_; }
  [[nodiscard]] double jitter_s() const noexcept;  ///< of a pulse, 1 sigma
  [[nodiscard]] std::uint64_t used() const noexcept { return used_; }
  [[nodiscard]] std::uint64_t left_out() const noexcept { return left_out_; }

 private:
  static constexpr std::uint64_t kPulsesToKnow = 3;

  void begin(HostTime time, UtcTime second) noexcept;
  [[nodiscard]] double variance_after(double step_s) const noexcept;

  SteeringLine steering_;
  HostTime origin_{};  ///< on the quartz, as all that follows
  UtcTime utc_origin_{};
  HostTime last_quartz_{};
  HostTime last_{};        ///< the same on the host's clock
  double offset_s_ = 0.0;  ///< UTC minus the quartz, since the origins, at last_
  double rate_ = 0.0;
  double p_offset_ = 0.0;  ///< covariance
  double p_rate_ = 0.0;
  double p_both_ = 0.0;
  double jitter_variance_s2_ = 0.0;
  double astray_s_ = 0.0;  ///< of the pulse before, where it was left out; 0: it was not
  std::uint64_t used_ = 0;
  std::uint64_t left_out_ = 0;
};

}  // namespace imuscope
