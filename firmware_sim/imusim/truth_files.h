#pragma once

/// What is true of a simulated run, as files: truth.json has the keys of imuscope's calibration.json,
/// truth.csv the columns of its navigation.csv. Times are seconds since the R-IMU's first sample.

#include <filesystem>
#include <string>

#include "firmware_sim/imusim/failure.h"
#include "firmware_sim/imusim/world.h"

namespace imusim {

/// Writes truth.json: per S-IMU mounting, biases, scales, latencies, sample times and noise parameters.
Outcome<void> write_truth_json(const World& world, const std::filesystem::path& folder);

/// Rows of truth.csv where nothing else is asked for: as many as imuscope's navigation.csv has.
inline constexpr double kTruthRows_hz = 10.0;
/// Writes truth.csv from the R-IMU's first sample to the end of the scenario.
Outcome<void> write_truth_csv(const World& world, const std::filesystem::path& folder,
                              double rows_hz = kTruthRows_hz);

/// The header and a row of errors_truth_NAME.csv: the columns of imuscope's errors_NAME.csv.
std::string error_header();
std::string error_row(const World& world, const TrueSample& sample);

/// Writes a file whole. @return a sentence where that fails
Outcome<void> write_file(const std::filesystem::path& path, const std::string& content);

/// Makes a folder for a run's files, where it does not exist.
Outcome<void> make_folder(const std::filesystem::path& folder);

}  // namespace imusim
