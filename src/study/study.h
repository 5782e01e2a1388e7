#pragma once

/// The study of a recording: calibration, then the error process with the final mounting over the whole
/// drive, then noise models per axis and regime. Everything is written to a run folder.

#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "estimation/calibration/combine.h"
#include "estimation/regimes/labels.h"
#include "service/recording/replay.h"

namespace imuscope {

/// Where a study writes, and what it is given beside recording and configuration.
struct StudyRunOptions {
  std::filesystem::path out;
  std::string version;
  /// Called with what is being done and the share of it that is done.
  std::function<void(const std::string& step, double share)> progress;
  /// Mountings settled beforehand, by name: the error process is made with these. Others use the drive's own.
  std::map<std::string, MountingEstimate> mountings;
  /// Regimes that a person named in a file; empty: as the configuration says.
  std::vector<Label> labels;
  /// Of the look at the data before, for run.json.
  std::vector<check::Finding> findings;
  /// Of how much of a recording a mounting is estimated, in place of an hour.
  std::optional<double> batch_longest_s{};
};

/// Runs the whole study of `recording` into options.out. Errors: what replay() refuses; a folder that cannot
/// be written; no S-IMU that could be calibrated (kWork).
Result<void> run_study(const Configuration& configuration, const Recording& recording,
                       const StudyRunOptions& options);

}  // namespace imuscope
