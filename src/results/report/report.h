#pragma once

/// The report of a run: one HTML page that carries everything it shows, to be read in a browser, printed or
/// sent. It is made from the files of a run folder alone, so it can be made again at any time.

#include <filesystem>

#include "base/result.h"

namespace imuscope {

/// Writes `report.html` into `run_dir`.
///
/// Reads what is there of: calibration.json (required), run.json, navigation.csv, per S-IMU
/// calibration_NAME.csv and errors_NAME.csv, models.json, regression.json, regimes.json, comparison.json,
/// dependence.json, vibration.json, evaluation.json and truth.json. What is absent is
/// named in the page and nothing is put in its place. Everything that comes from these files is escaped; the
/// page loads nothing from anywhere. Memory is bounded: long signals are kept as smallest, mean and largest
/// value of short stretches.
///
/// Errors: the folder or its calibration.json is missing or cannot be read as what it should be; a file that
/// is there but broken (a JSON that does not parse, a CSV without its columns); report.html cannot be
/// written. Thread-safe for different folders.
Result<void> write_report(const std::filesystem::path& run_dir);

}  // namespace imuscope
