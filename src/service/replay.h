#pragma once

/// Recorded bytes through the same core as the live service, on virtual ticks. Where a recording has no
/// arrival stamps, arrival is device time plus time on the wire, and the devices' clocks are brought together
/// by content (clock_alignment.h).

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "base/result.h"
#include "drivers/device/device.h"
#include "regimes/labels.h"
#include "service/byte_source.h"
#include "service/clock_alignment.h"
#include "service/config.h"
#include "service/core.h"
#include "service/number_ranges.h"
#include "service/run_folder.h"
#include "service/run_record.h"

namespace imuscope {

/// Opens the recorded bytes of device `index` from their beginning; a study reads them more than once.
using OpenSource = std::function<Result<std::unique_ptr<ByteSource>>(DeviceIndex index)>;

/// Between two arrivals; no drive pauses as long.
inline constexpr Duration kLongestPause = std::chrono::hours(24);

/// What a recording says about the live run it came from, so that a replay repeats it tick by tick.
struct RecordedSchedule {
  HostTime t0{};  ///< cut of tick 0
  CoreSchedule core;
  NumberRanges skipped_ticks;
  /// By device: sequence numbers of samples that found their ring full, which the core never saw.
  std::map<DeviceIndex, NumberRanges> refused_samples;
};

/// A recording, ready to be replayed any number of times.
struct Recording {
  std::vector<std::string> inputs;  ///< as given, for run.json
  OpenSource open;
  std::vector<bool> present;                 ///< per device of the configuration
  std::vector<DeviceClock> clocks;           ///< per device
  std::optional<RecordedSchedule> schedule;  ///< of a capture of a live run
  std::vector<MarkedMoment> moments;         ///< that a person marked while it was recorded
};

/// Names and clock shifts of the S-IMUs, in the order of the configuration.
std::vector<StudyFileInfo> study_file_infos(const Configuration& configuration, const Recording& recording);

/// What a replay did: counts by device of the configuration, the cut of tick 0, and the ticks run (skipped
/// ones do not count).
struct ReplayResult {
  std::vector<DeviceRecord> devices;
  HostTime t0{};
  std::int64_t ticks = 0;
};

/// How a recording is run through the core; replay() calls the callbacks from its caller's thread.
struct ReplayOptions {
  bool realtime = false;                 ///< paced as recorded
  std::function<void(double)> progress;  ///< share of the bytes read, 0 to 1; called now and then
  HistorySink* history = nullptr;
  /// Sees every sample as it was decoded, device by device in stream order; may be empty.
  std::function<void(const Sample&)> on_sample;
};

/// Runs the recording through a core made from `estimator`. Errors: a recording that cannot be read, or that
/// holds no sample of the reference or of any study (kWork).
///
/// What follows a pause of all devices of more than kLongestPause is left out, and told as a problem of each
/// device that has more: no drive has such a pause, a damaged stamp has.
Result<ReplayResult> replay(const Configuration& configuration, const EstimatorConfig& estimator,
                            const Recording& recording, CoreSink& sink, const ReplayOptions& options = {});

}  // namespace imuscope
