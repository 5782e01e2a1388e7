#pragma once

/// What `imuscope export` makes of a whole run.

#include <filesystem>
#include <string>
#include <vector>

#include "base/result.h"

namespace imuscope::cli {

struct ExportRun {
  std::filesystem::path run;
  std::string out;                  ///< empty: beside the run's files
  std::string compression;          ///< zstd, lz4, none
  std::vector<std::string> inputs;  ///< the recording, where it is no longer where it was
  std::string config;
  bool with_errors = false;
};

/// Writes the run as an MCAP file and says what it holds.
Result<void> export_mcap(const ExportRun& options);

/// Whether a path is what a mounting is read from: a run folder or a calibration.json.
[[nodiscard]] bool has_mountings(const std::filesystem::path& path);
/// Prints the mounting of one S-IMU.
/// @param name    may be empty where there is one only
/// @param format  urdf, tf, kalibr, openvins or json
Result<void> export_mounting(const std::filesystem::path& path, const std::string& name,
                             const std::string& format);

}  // namespace imuscope::cli
