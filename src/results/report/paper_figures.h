#pragma once

/// The figures of a run for papers and slides: SVG and PDF, drawn by gnuplot from scripts that stay beside
/// them, so that a figure can be restyled without a run.

#include <filesystem>
#include <string>
#include <vector>

#include "base/result.h"

namespace imuscope {

/// Writes RUN_DIR/figures/NAME.gp, .svg and .pdf: drive; per S-IMU figure1 (boresight and lever arm with sd
/// over time), figure2 (error signals), figure3 (errors against the motion), figure4 (wavelet variance with
/// intervals, fitted total and components). What the run does not hold is left out.
///
/// Returns the files written. Errors: those of write_report(); gnuplot is not there or fails (kWork).
Result<std::vector<std::filesystem::path>> write_figures(const std::filesystem::path& run_dir);

}  // namespace imuscope
