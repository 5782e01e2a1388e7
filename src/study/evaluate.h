#pragma once

/// Does the noise model matter? The S-IMU navigates alone with GNSS, coasts through outages of it, and what
/// its filter predicts under each noise model is held against the errors it makes. Writes evaluation.json
/// into the run folder. Non-real-time.

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/result.h"
#include "study/evaluation/outages.h"

namespace imuscope {

/// Which run is evaluated, by the folder that its study wrote, and on which outages.
struct EvaluationRunOptions {
  std::filesystem::path run_dir;
  std::vector<std::string> inputs;      ///< empty: those that run.json names
  std::filesystem::path configuration;  ///< empty: the one that run.json holds
  OutageOptions outages;
  std::function<void(const std::string& step, double share)> progress;
};

/// evaluation.json's content:
///
/// {"schema", "durations_s", "evaluations": [{"name", "model", "source", "duration_s", "n", "n_independent",
/// "horizontal_rms_m", "horizontal_sd_m", "vertical_rms_m", "vertical_sd_m", "velocity_rms_mps",
/// "velocity_sd_mps", "attitude_rms_deg", "attitude_sd_deg", "nees_position", "nees_velocity",
/// "nees_attitude", "nees_low", "nees_high", "surprise"}], "absent": [{"name", "model", "why"}]}
///
/// Errors: a folder that no study wrote; recordings that are no longer where they were; no GNSS; no outage
/// that fits into the drive (kWork, kUsage for what was typed).
Result<nlohmann::json> evaluate_run(const EvaluationRunOptions& options);

}  // namespace imuscope
