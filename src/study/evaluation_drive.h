#pragma once

/// A recorded drive as the outage evaluation wants it: S samples, GNSS solutions and the reference trajectory
/// of a finished run, all on the run's time and at the S-IMU's place. Non-real-time.

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <vector>

#include "base/result.h"
#include "service/recording/recording.h"
#include "study/evaluation/outages.h"

namespace imuscope {

/// One S-IMU's drive, and the regime in force from each time on.
struct StudyDrive {
  std::string name;
  Drive drive;
  std::vector<std::pair<double, Regime>> regimes;
};

/// Replays the recording with the mountings of `calibration` (calibration.json) and reads the trajectory from
/// the run folder (smoothed_navigation.csv, else navigation.csv). S-IMUs that were not calibrated are left
/// out. Errors: no GNSS device; no trajectory; a recording that cannot be replayed (kWork).
Result<std::vector<StudyDrive>> evaluation_drives(const OpenedRecording& opened,
                                                  const std::filesystem::path& run_dir,
                                                  const nlohmann::json& calibration,
                                                  const std::function<void(double)>& progress);

}  // namespace imuscope
