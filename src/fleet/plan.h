#pragma once

/// The tasks of a campaign: one study per capture, then one summary per unit. A task is named by its key, a
/// hash of all that its result depends on: the capture's content, configuration, options and the program itself.
/// What stands under the key is the result, so that the folder of results is all the state that a campaign
/// has.

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "fleet/fleet_file.h"

namespace imuscope::fleet {

/// A recording of the fleet, first file and what follows it.
struct Capture {
  std::string name;  ///< its path below the folder that was searched
  std::vector<std::filesystem::path> files;
  std::uintmax_t bytes = 0;
  std::string sha256;                   ///< of its files
  std::optional<std::size_t> mounting;  ///< place in FleetFile::mountings
  std::string key;                      ///< of its study; empty where it is not studied
  std::string not_studied;              ///< why
};

/// A study of one capture, as a command line tells it.
struct StudyTask {
  std::filesystem::path out;  ///< folder of the campaign
  std::string key;
  std::string name;
  std::vector<std::filesystem::path> files;
  std::optional<std::filesystem::path> config;
  bool keep_all_files = false;
  TaskLimits limits;
};

/// One unit over all its captures.
struct UnitTask {
  std::filesystem::path out;
  std::string key;
  std::string unit;
  /// A study with the device that the unit was in it.
  struct Drive {
    std::string study_key;
    std::string device;
    std::string mounting;  ///< "VEHICLE/NAME"
  };
  std::vector<Drive> drives;
};

/// All of a campaign.
struct Plan {
  std::string program;  ///< program_identity()
  std::vector<Capture> captures;
  std::vector<StudyTask> studies;  ///< of captures that differ
  std::vector<UnitTask> units;
};

/// Key of a study, from what it reads. Errors: kWork, a file that cannot be read.
Result<std::string> study_key(const std::string& program, const std::string& capture_sha256,
                              const std::optional<std::filesystem::path>& config, bool keep_all_files);

/// Finds the captures and their content. Hashes are kept in OUT/hashes.json and taken from there while size
/// and time of a file stay. Errors: a folder that is not there, two captures of one name (kUsage); files that
/// cannot be read (kWork).
Result<Plan> plan_campaign(const FleetFile& fleet, const std::string& program);

/// The commands that make up a campaign, one a line, in an order in which they may run: "imuscope fleet study
/// ...".
std::vector<std::string> command_of(const StudyTask& task);
std::vector<std::string> command_of(const UnitTask& task);

/// As a shell reads it back.
std::string shell_line(const std::vector<std::string>& words);

}  // namespace imuscope::fleet
