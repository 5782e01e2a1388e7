#pragma once

/// Recordings without arrival stamps: each device's clock is brought to the reference's by what it recorded.
/// UTC tags where both have them, otherwise the angular rate of the moving vehicle, which every IMU on it
/// shares.

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "configuration/config.h"
#include "sample/clock_map.h"

namespace imuscope {

/// How the times of one device are mapped.
struct DeviceClock {
  ClockMapConfig map{};  ///< online for a stamped recording
  double shift_s = 0.0;  ///< what was added to the device's own time at mid-record; 0 for stamped ones
  double shift_sd_s = 0.0;
  std::string how = "arrival stamps";  ///< for the log and run.json
};

/// Whether the configuration says that the times of a recording without stamps are the reference's.
[[nodiscard]] bool shares_the_reference_clock(const DeviceConfig& device);

/// All samples of one device, its times taken as they stand in the recording.
using ReadSamples = std::function<Result<std::vector<Sample>>(DeviceIndex)>;

/// @param unstamped  per device: present, and without arrival stamps
/// @param read       decodes one device with a clock that starts at zero
/// @return per device; devices that are stamped or absent keep the online map
/// Errors (kWork): no reference, or a study that cannot be brought to it, with the reason.
Result<std::vector<DeviceClock>> align_clocks(const Configuration& configuration,
                                              const std::vector<bool>& unstamped, const ReadSamples& read);

/// UTC minus the time of the samples: their median, since a single tag may be damaged. Nothing where none has
/// a tag.
[[nodiscard]] std::optional<Duration> utc_minus_time(const std::vector<Sample>& samples);

/// What is known when a log is to be brought to the run's time scale.
struct LogStamps {
  bool are_utc = false;                ///< otherwise times of any origin
  bool are_the_runs = false;           ///< the reference is in the same log
  std::optional<Duration> utc_of_run;  ///< UTC minus the run's time, where a device of the run tells it
};

/// The time scale of a log whose stamps are the wall clock of the PC that wrote it.
/// @param read_reference  its samples, on the time scale of the run
/// @param read_own        decodes the log with its own stamps
/// Errors (kWork): nothing brings the log to the run's time, with the remedy.
Result<DeviceClock> align_log(const DeviceConfig& device, const LogStamps& stamps,
                              const std::function<Result<std::vector<Sample>>()>& read_reference,
                              const std::function<Result<std::vector<Sample>>()>& read_own);

}  // namespace imuscope
