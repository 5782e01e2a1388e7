#pragma once

/// fleet.toml: which captures there are, which unit was mounted where in them, and how they are studied.

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"

namespace imuscope::fleet {

/// A time in which nothing on a vehicle was taken off or put on.
struct MountingCampaign {
  std::string vehicle;
  std::string name;
  /// Its captures, by their names: '*' is any text, '?' any character.
  std::vector<std::string> captures;
  std::map<std::string, std::string> units;  ///< serial number by the device's name in the configuration
};

/// What a task may take.
struct TaskLimits {
  int attempts = 3;        ///< that ended by themselves without a result
  double memory_mb = 0.0;  ///< of one task; 0: what there is
  double timeout_s = 0.0;  ///< of one attempt; 0: none
};

/// fleet.toml, checked.
struct FleetFile {
  std::filesystem::path file;
  std::string name;
  std::vector<std::filesystem::path> captures;  ///< folders, which are searched, and files
  std::filesystem::path out;
  std::optional<std::filesystem::path> config;  ///< in place of the captures' own
  bool keep_all_files = false;                  ///< of every run folder, its rows included
  TaskLimits limits;
  /// A unit meets its certificate, or its data sheet, where no axis' noise is above this many times it.
  double certificate_factor = 1.25;
  std::vector<MountingCampaign> mountings;  ///< the first that a capture fits is its own; at least one
  std::map<std::string, std::filesystem::path> certificates;  ///< by serial number
};

/// Paths in the file are relative to its folder. Errors: kUsage, with file and line.
Result<FleetFile> read_fleet_file(const std::filesystem::path& file);

/// The place in `mountings` of the first that takes a capture of this name.
std::optional<std::size_t> mounting_of(const FleetFile& fleet, const std::string& capture);

/// The unit behind a device of a mounting; where the file names none: "VEHICLE/DEVICE".
std::string unit_of(const MountingCampaign& mounting, const std::string& device);

}  // namespace imuscope::fleet
