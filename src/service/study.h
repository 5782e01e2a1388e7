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
#include "calibration/combine.h"
#include "regimes/labels.h"
#include "service/replay.h"
#include "service/run_folder.h"

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
};

/// What a run is made of, for run.json.
struct RunDescription {
  std::string version;
  const Configuration* configuration = nullptr;
  const Recording* recording = nullptr;
  const ReplayResult* result = nullptr;
  const Snapshot* last = nullptr;
  std::vector<EstimatorEvent> events;
  std::vector<std::string> warnings;
  std::optional<double> static_s{};  ///< of a study, which tells rest from motion
  std::optional<double> dynamic_s{};
};

/// run.json's content.
nlohmann::json run_json(const RunDescription& run);

/// What a person should know of an event, in one sentence.
std::string describe(const Configuration& configuration, const EstimatorEvent& event);

/// Names and clock shifts of the S-IMUs, in the order of the configuration.
std::vector<StudyFileInfo> study_file_infos(const Configuration& configuration, const Recording& recording);

/// Runs the whole study of `recording` into options.out. Errors: what replay() refuses; a folder that cannot
/// be written; no S-IMU that could be calibrated (kWork).
Result<void> run_study(const Configuration& configuration, const Recording& recording,
                       const StudyRunOptions& options);

/// How a recording is played.
struct PlayOptions {
  bool realtime = false;  ///< paced as recorded
  std::string lcm_url;    ///< publishes what a live run would, here; empty: nothing
};

/// Replays `recording` once and writes navigation.csv, calibration_NAME.csv, errors_NAME.csv with the
/// estimates as they stood, calibration.json and run.json.
Result<void> run_replay(const Configuration& configuration, const Recording& recording,
                        const StudyRunOptions& options, const PlayOptions& play);

}  // namespace imuscope
