#pragma once

/// What a run folder says, as a table for the terminal.

#include <filesystem>

#include "base/result.h"

namespace imuscope::cli {

/// Prints mounting and time offset of every S-IMU with their sd, beside the truth where the folder holds a
/// truth.json, one noise model, warnings, and where the report is. With `json`, calibration.json and the rest
/// as one object on stdout instead.
Result<void> print_study(const std::filesystem::path& run_folder, bool json);

}  // namespace imuscope::cli
