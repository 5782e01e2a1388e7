#pragma once

/// Seconds of UTC on the host's time scale. A PC's quartz is wrong by tens of ppm, and a rate that is
/// integrated over its seconds turns too far or too little by as much. Whatever tells UTC tells the length of
/// a second: the scale follows those tags smoothly, so that an interval between two instants is one of true
/// seconds and no tick of a device shows in it.
///
/// Kalman filter of two states, UTC minus host time and its rate: both wander, the first as a clock map's
/// line does that settles, the second as a quartz does that warms up. The tags' errors are taken as white.
///
/// Pulses that mark seconds (PPS) tell the host's clock far better than any message does; the tags of a
/// receiver, or the PC's wall clock where nothing else tells UTC, say which second is meant. Samples of the
/// R-IMU have their times from a clock map, which leaves the constant delay of their stream in them. The
/// R-IMU's own tags know of it, as they say which sample is of which instant; pulses do not. So where the
/// R-IMU tells UTC the scale follows it, and the pulses measure the delays of the streams; where it does not,
/// the scale follows the pulses.
///
/// Deterministic: a function of the observations alone.

#include <cstdint>
#include <limits>

#include "base/time.h"
#include "sample/pulse_clock.h"

namespace imuscope {

/// Who told UTC. The PC's clock says what time it was at the start, but not how long a second is.
enum class UtcSource : std::uint8_t { kNone, kReference, kGnss, kPcClock, kPulses };

/// Whether a device has told UTC, and with it the length of a second.
[[nodiscard]] constexpr bool is_told_by_device(UtcSource source) noexcept {
  return source == UtcSource::kReference || source == UtcSource::kGnss || source == UtcSource::kPulses;
}

/// An instant of the run in UTC.
struct UtcStamp {
  UtcTime utc{};
  std::int32_t gps_minus_utc_s = 0;  ///< leap seconds: what follows one is a second of GPS time later
  bool is_known = false;             ///< otherwise nobody has told UTC
};

/// A constant delay, from an instant to the time that a stream gives it on the host's clock.
struct StreamDelay {
  double mean_s = std::numeric_limits<double>::quiet_NaN();  ///< NaN: not measured
  double sd_s = std::numeric_limits<double>::quiet_NaN();    ///< of what is measured at a time
};

/// The host's clock by pulses, for those who show or record it.
struct PulseState {
  bool is_known = false;
  bool counted_by_pc_clock = false;  ///< no device told which second a pulse marks
  HostTime time{};                   ///< of the newest pulse, or change of how the host's clock is steered
  UtcTime utc{};                     ///< at `time`
  double sd_utc_s = 0.0;
  double rate = 0.0;  ///< UTC seconds per host second, minus 1
  double sd_rate = 0.0;
  double jitter_s = 0.0;  ///< of a pulse, 1 sigma
  std::uint64_t used = 0;
  std::uint64_t left_out = 0;
  StreamDelay reference_delay{};  ///< of the R-IMU's samples
  StreamDelay gnss_delay{};       ///< of the receiver's solutions
};

/// The scale at one instant, for those who show or record it.
struct TimeScale {
  UtcSource source = UtcSource::kNone;  ///< kNone, kPcClock: seconds are the host's own, within sd_rate
  HostTime time{};                      ///< of the newest observation
  UtcTime utc{};                        ///< at `time`
  double sd_utc_s = 0.0;  ///< of utc; a receiver's delay in it, which nobody tells. NaN: not known
  double rate = 0.0;      ///< UTC seconds per host second, minus 1
  double sd_rate = 50e-6;
  std::uint32_t steps = 0;           ///< times that the tags stepped by more than the scale can follow
  std::int32_t gps_minus_utc_s = 0;  ///< leap seconds
  PulseState pulses{};

  /// Any instant near `time` on the line through the tags.
  [[nodiscard]] UtcStamp at(HostTime instant) const noexcept {
    const Duration step = instant - time;
    return {utc + step + from_seconds(rate * to_seconds(step)), gps_minus_utc_s, source != UtcSource::kNone};
  }
  /// The instant of a UTC near `utc`.
  [[nodiscard]] HostTime host_time(UtcTime instant) const noexcept {
    const Duration step = instant - utc;
    return time + step - from_seconds(rate / (1.0 + rate) * to_seconds(step));
  }
};

/// Core: no allocation, noexcept. Not thread-safe; trivially copyable.
class UtcScale {
 public:
  /// A time of validity on both scales. Of several devices, the R-IMU is believed as long as it tells UTC; a
  /// receiver's tags count where it has not for some seconds. Times need not rise; an observation that is
  /// older than the last one is left out.
  void observe(UtcSource source, HostTime time, UtcTime utc) noexcept;

  /// A pulse that marks a second of UTC.
  /// @param wall  what the PC's wall clock showed
  void observe_pulse(HostTime time, UtcTime wall) noexcept;

  /// The host's clock is steered otherwise from here on (SteeringLine): the pulses' line bends with it.
  void observe_steering(HostTime time, HostTime unsteered, double rate) noexcept;

  /// What the PC's clock showed: for those who want to know what time it is, until a device tells.
  void set_pc_clock(HostTime time, UtcTime utc) noexcept;

  /// What navigation has found that the tags of a source come later than the R-IMU's samples of the same
  /// instant, beyond what stands in their times: taken out of the UTC that is told while that source tells.
  void set_found_delay(UtcSource source, double delay_s, double sd_s) noexcept;

  /// The instant that pulses give a UTC, whatever navigation has found. Precondition: the source is kPulses.
  [[nodiscard]] HostTime host_time_by_pulses(UtcTime utc) const noexcept;

  /// True seconds since an instant that never moves: differences are intervals. Tags that step (a leap
  /// second, a receiver that found the time) leave it alone.
  [[nodiscard]] double seconds_at(HostTime time) const noexcept;

  /// Whether a device has told UTC, and with it the length of a second.
  [[nodiscard]] bool is_known() const noexcept { return is_told_by_device(scale_.source); }
  [[nodiscard]] const TimeScale& scale() const noexcept { return scale_; }

 private:
  [[nodiscard]] double offset_at(HostTime time) const noexcept;
  void begin(UtcSource source, HostTime time, UtcTime utc) noexcept;
  void predict(double step_s) noexcept;
  void publish(UtcSource source) noexcept;
  [[nodiscard]] UtcTime second_of(HostTime time, UtcTime wall) noexcept;
  void measure_delay(UtcSource source, HostTime time, UtcTime utc) noexcept;
  void count_seconds_anew(HostTime time, Duration by, UtcTime utc) noexcept;
  void tell_pulses(HostTime time) noexcept;
  void follow_pulses(HostTime time) noexcept;
  [[nodiscard]] double reference_delay_s() const noexcept;
  [[nodiscard]] double delay_sd_s(UtcSource source) const noexcept;
  [[nodiscard]] bool is_found(UtcSource source) const noexcept;

  TimeScale scale_;
  HostTime origin_{};     ///< of seconds_at()
  UtcTime utc_origin_{};  ///< what origin_ is in UTC where offset_s_ is zero; moves with steps
  HostTime last_{};
  HostTime last_reference_{};
  double offset_s_ = 0.0;  ///< UTC minus host time, since the origins
  double rate_ = 0.0;
  double p_offset_ = 0.0;  ///< covariance
  double p_rate_ = 0.0;
  double p_both_ = 0.0;
  int astray_in_a_row_ = 0;
  struct FoundDelay {
    UtcSource source = UtcSource::kNone;
    double delay_s = 0.0;
    double sd_s = 0.0;
  };
  FoundDelay found_;
  PulseClock pulses_;
  int pulses_astray_in_a_row_ = 0;
  int miscounted_in_a_row_ = 0;
};

}  // namespace imuscope
