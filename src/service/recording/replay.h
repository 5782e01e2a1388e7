#pragma once

/// Recorded bytes through the same core as the live service, on virtual ticks. Where a recording has no
/// arrival stamps, arrival is device time plus time on the wire, and the devices' clocks are brought together
/// by content (clock_alignment.h).

#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "base/result.h"
#include "configuration/config.h"
#include "drivers/device/device.h"
#include "estimation/regimes/labels.h"
#include "service/pipeline/core.h"
#include "service/recording/byte_source.h"
#include "service/recording/clock_alignment.h"
#include "service/run/number_ranges.h"
#include "service/run/run_folder.h"
#include "service/run/run_record.h"

namespace imuscope {

/// Opens the recorded bytes of device `index` from their beginning; a study reads them more than once.
using OpenSource = std::function<Result<std::unique_ptr<ByteSource>>(DeviceIndex index)>;

/// A pause is when no device has said anything for longer than the core's tail (kTailTicks). All pauses of a
/// drive together are shorter than this.
inline constexpr Duration kLongestPause = std::chrono::hours(24);

/// Of a longer pause the rest is stepped over: every filter has settled by then, and a tick does nothing.
inline constexpr Duration kLongestIdle = std::chrono::minutes(2);

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
  /// The same of all devices, null for those that are not present, by one pass where the recording is one
  /// file: for those who go through them side by side.
  std::function<Result<std::vector<std::unique_ptr<ByteSource>>>(Reading)> open_side_by_side;
  /// Lines of open_side_by_side() have nothing in common: each may be read by a thread of its own.
  bool has_lines_apart = false;
  std::vector<bool> present;                 ///< per device of the configuration
  std::vector<DeviceClock> clocks;           ///< per device
  std::optional<RecordedSchedule> schedule;  ///< of a capture of a live run
  /// What the PC's clock showed, and when, where the recording says it.
  struct PcClock {
    HostTime time{};
    UtcTime utc{};
  };
  std::optional<PcClock> pc_clock{};
  std::vector<MarkedMoment> moments;  ///< that a person marked while it was recorded
  std::vector<std::string> damage;    ///< what is missing of it or damaged, with what it costs, in sentences
};

/// Names and clock shifts of the S-IMUs, in the order of the configuration.
std::vector<SImuFileInfo> study_file_infos(const Configuration& configuration, const Recording& recording);

/// Pauses of which a part was stepped over.
struct SteppedPauses {
  std::int64_t n = 0;
  Duration total{};
  Duration longest{};
};

/// What a replay did: counts by device of the configuration, the cut of tick 0, and the ticks run (skipped
/// ones do not count; those of a pause that was stepped over do, as a live run has them).
struct ReplayResult {
  std::vector<DeviceRecord> devices;
  HostTime t0{};
  std::int64_t ticks = 0;
  SteppedPauses pauses;
};

/// How a recording is run through the core; replay() calls the callbacks from its caller's thread, and the sink
/// unless another is asked for.
struct ReplayOptions {
  bool realtime = false;                 ///< paced as recorded
  std::function<void(double)> progress;  ///< share of the bytes read, 0 to 1; called now and then
  HistorySink* history = nullptr;
  Reading reading = Reading::kWhenAsked;
  /// The sink works in a thread of its own, beside the core, and has done all of it when replay() returns.
  bool has_sink_beside = false;
  /// Sees every sample as it was decoded, device by device in stream order; may be empty.
  std::function<void(const Sample&)> on_sample;
  /// Where it becomes true, the replay ends soon, with an error (kWork): nobody wants its result any more.
  const std::atomic<bool>* is_given_up = nullptr;
};

/// Runs the recording through a core made from `estimator`. Errors: a recording that cannot be read, or that
/// holds no sample of the reference or of any study (kWork).
///
/// What follows once the pauses add up to more than kLongestPause is left out, and told as a problem of each
/// device that has more: no drive has such pauses, damaged or forged stamps have. So a replay's time and what
/// it writes are bounded by the size of the recording.
Result<ReplayResult> replay(const Configuration& configuration, const EstimatorConfig& estimator,
                            const Recording& recording, CoreSink& sink, const ReplayOptions& options = {});

/// What a person should know of a replay: what is missing of its recording, pauses that were stepped over.
[[nodiscard]] std::vector<std::string> warnings_of(const Recording& recording, const ReplayResult& result);

}  // namespace imuscope
