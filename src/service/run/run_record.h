#pragma once

/// run.json: what a run was made of and what became of it. A live run, a replay and the study of a recording
/// fill in the same record.

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/output_folder.h"
#include "base/result.h"
#include "check/finding.h"
#include "configuration/config.h"
#include "drivers/device/device.h"
#include "service/pipeline/core.h"
#include "service/run/pc_clock.h"
#include "service/run/time_budget.h"
#include "service/run/utc_track.h"

namespace imuscope {

/// What became of one device's bytes.
struct DeviceRecord {
  DecoderCounters counters;
  std::uint64_t refused = 0;                ///< samples that found their ring full
  std::uint64_t frames_dropped = 0;         ///< of a live run: lost by this PC before they could be read
  std::string problem;                      ///< in one sentence with the remedy; empty when all is well
  std::string clock = "arrival stamps";     ///< how its times were mapped
  double clock_shift_s = 0.0;               ///< what was added to its own time at mid-record
  std::optional<TimeBudget> time_budget{};  ///< of a live run
};

struct RunRecord {
  const Configuration& configuration;
  std::string version;
  std::vector<std::string> inputs;    ///< as given; "live"
  std::vector<DeviceRecord> devices;  ///< of the configuration
  std::int64_t ticks = 0;             ///< those that were skipped do not count
  const Snapshot* last = nullptr;     ///< absent where there was no tick
  std::vector<EstimatorEvent> events{};
  std::vector<std::string> warnings{};
  std::vector<std::string> notes{};  ///< what was left out of a study, and why; nothing is wrong for that
  /// Of the look at the data before; absent where nobody has looked yet.
  std::optional<std::vector<check::Finding>> findings{};
  std::optional<double> static_s{};  ///< of a study, which tells rest from motion
  std::optional<double> dynamic_s{};
  const UtcTrack* utc = nullptr;            ///< of the run, for its events
  const PcClockRecord* pc_clock = nullptr;  ///< of a live run
  std::string error_process_mounting{};     ///< of a study: whose mounting the error process was made with
};

/// run.json's content.
nlohmann::json run_json(const RunRecord& run);
Result<void> write_run_record(const OutputFolder& folder, const RunRecord& run);

/// As run.json has them.
nlohmann::json findings_json(const std::vector<check::Finding>& findings);

/// What a person should know of a finished run: GNSS that contradicts the motion, S-IMUs without a mounting.
[[nodiscard]] std::vector<std::string> warnings_of(const Configuration& configuration, const Snapshot& last);

}  // namespace imuscope
