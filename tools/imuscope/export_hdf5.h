#pragma once

/// `imuscope export RUN --to hdf5`.

#include <filesystem>

#include "base/result.h"

namespace imuscope::cli {

/// @param file   to write; empty: run.h5 in the run folder
/// @param force  also in place of a file that is there
/// Errors: those of hdf5::export_run(); a part of imuscope that is not installed (kUsage), with the command
/// that brings it.
Result<void> export_hdf5(const std::filesystem::path& run_folder, std::filesystem::path file, bool force);

}  // namespace imuscope::cli
