#pragma once

/// What lies between an instant that a device measured and its time in a run: what is known of it, what is
/// estimated, and what nobody knows.

#include <limits>
#include <string_view>

#include "configuration/config.h"
#include "estimation/calibration/estimator.h"
#include "service/lines/io_thread.h"

namespace imuscope {

/// Of one device of a live run. NaN: unknown.
struct TimeBudget {
  static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

  StampedBy stamped_by = StampedBy::kRead;  ///< who says when bytes arrived
  double stamp_lead_s =
      kUnknown;  ///< mean, by which those stamps are before the reads; NaN where the read stamps
  double stamp_lead_sd_s = kUnknown;  ///< of single ones: jitter that does not reach the clock's line
  double wire_s = 0.0;  ///< of the bytes of a sample, mean, on a serial line at the rate in force; stamps are
                        ///< dated back by it; 0 on other lines
  double adapter_s = 0.0;             ///< an adapter may hold bytes for up to so long; 0 where none is known
  double latency_s = kUnknown;        ///< from the time of validity to the read, mean over the last second
  double clock_sd_s = kUnknown;       ///< scatter about the line from the device's clock to the host's
  double clock_drift_ppm = kUnknown;  ///< of that line: the device's clock is fast where positive
  /// Of an S-IMU: its constant delay against the reference, whatever it is made of, which is estimated and
  /// taken out. That of any other device nobody measures.
  double t_d_s = kUnknown;
  double sd_t_d_s = kUnknown;  ///< what remains unknown of it
  /// From an instant that the device measured to the time that its clock map gives it, where pulses of UTC
  /// and the tags of the device (of an S-IMU: those of the reference) tell it. Of a receiver beyond the
  /// configured latency.
  double delay_s = kUnknown;
  double sd_delay_s = kUnknown;
};

/// @param study   the newest estimate of an S-IMU; null for other devices and before the first
/// @param pulses  what they tell of the run's clock
[[nodiscard]] TimeBudget time_budget(const LineStatus& line, const SImuOutput* study,
                                     DeviceRole role = DeviceRole::kStudy,
                                     const PulseState& pulses = {}) noexcept;
[[nodiscard]] std::string_view name_of(StampedBy by) noexcept;

}  // namespace imuscope
