#pragma once

/// Opens what the user names on the command line as one recording.

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "check/finding.h"
#include "service/recording/replay.h"

namespace imuscope {

/// A recording together with the configuration that it is to be read with.
struct OpenedRecording {
  Configuration configuration;
  Recording recording;
  std::vector<std::string> remarks;  ///< for the log: clocks brought together, devices without data, losses
  std::vector<check::Finding> findings;  ///< of the look at the data, where somebody asked for it
};

/// Is told what is being read to find clocks and counts, and how far it is, 0 to 1; may be empty.
using OpeningProgress = std::function<void(const std::string& what, double share)>;

/// @param inputs         either one capture (an LCM event log), or raw dumps as NAME=FILE, NAME being a
///                       device of the configuration
/// @param configuration  absent: the one kept in the capture; required with raw dumps
/// @param findings       what the data show to be wrong, also where it keeps clocks from being brought
///                       together; null: nobody looks
/// Errors of kind kUsage for what was typed or configured, kWork for files that cannot be used.
Result<OpenedRecording> open_recording(const std::vector<std::string>& inputs,
                                       const std::optional<std::filesystem::path>& configuration,
                                       const OpeningProgress& progress = {},
                                       std::vector<check::Finding>* findings = nullptr);

/// The same for raw dumps and a configuration at hand.
Result<OpenedRecording> open_dumps(const std::vector<std::string>& inputs, Configuration configuration,
                                   const OpeningProgress& progress = {});

}  // namespace imuscope
