#pragma once

/// The recording that a run was made of, by its run.json.

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "service/recording/recording.h"

namespace imuscope {

/// Which run, and where its recording is now.
struct RunSource {
  std::filesystem::path run_dir;
  std::vector<std::string> inputs;      ///< empty: those that run.json names; of a live run its own capture
  std::filesystem::path configuration;  ///< empty: the one that run.json holds
};

/// @param run  run.json
/// Errors: a recording that is no longer where it was; run.json holds no configuration.
Result<OpenedRecording> open_recording_of_run(const RunSource& source, const nlohmann::json& run,
                                              const OpeningProgress& progress = {});

}  // namespace imuscope
