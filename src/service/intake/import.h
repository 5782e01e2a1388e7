#pragma once

/// Recordings of all kinds into one capture.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"

namespace imuscope {

/// What is imported, and where to.
struct ImportOptions {
  std::vector<std::string> inputs;                     ///< NAME=FILE of each device
  std::optional<std::filesystem::path> configuration;  ///< absent: drafted from what the files hold
  std::filesystem::path out;                           ///< the capture; must not exist
  std::string version;                                 ///< of the program
  std::function<void(double)> progress;                ///< share of the bytes, 0 to 1; may be empty
};

/// What went into the capture, for the person who asked.
struct Imported {
  /// What one device contributed, by its name in the configuration.
  struct Device {
    std::string name;
    std::uint64_t reads = 0;
    std::uint64_t bytes = 0;
    std::string times;  ///< where its arrival stamps come from
  };
  std::vector<Device> devices;
  std::vector<std::string> remarks;  ///< for the log
  bool drafted = false;              ///< the configuration was
};

/// Reads keep their boundaries and arrivals where the files have them. Where none has, each read ends with a
/// sample and arrives when the sample's own time, brought to the reference's, says so.
/// Errors of kind kUsage for what was typed or configured, kWork for files that cannot be used.
Result<Imported> import_recording(const ImportOptions& options);

}  // namespace imuscope
