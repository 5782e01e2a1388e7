#pragma once

/// A recording played as it was lived: the files, the refits and, where wanted, the messages of the run.

#include <filesystem>
#include <functional>
#include <string>

#include "base/result.h"
#include "service/recording/replay.h"

namespace imuscope {

/// Where a replay writes, and how it is played.
struct ReplayRunOptions {
  std::filesystem::path out;
  std::string version;
  std::function<void(double share)> progress;  ///< share of the bytes read, now and then; may be empty
  bool realtime = false;                       ///< paced as recorded
  std::string lcm_url;                         ///< publishes what a live run would, here; empty: nothing
};

/// Replays `recording` once and writes navigation.csv, calibration_NAME.csv, errors_NAME.csv with the
/// estimates as they stood, calibration.json and run.json.
Result<void> run_replay(const Configuration& configuration, const Recording& recording,
                        const ReplayRunOptions& options);

}  // namespace imuscope
