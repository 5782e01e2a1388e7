#pragma once

/// Opens what the user names on the command line as one recording.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "service/replay.h"

namespace imuscope {

/// A recording together with the configuration that it is to be read with.
struct OpenedRecording {
  Configuration configuration;
  Recording recording;
  std::vector<std::string> remarks;  ///< for the log: clocks brought together, devices without data, losses
};

/// @param inputs         either one capture (an LCM event log), or raw dumps as NAME=FILE, NAME being a
/// device of
///                       the configuration
/// @param configuration  absent: the one kept in the capture; required with raw dumps
/// Errors of kind kUsage for what was typed or configured, kWork for files that cannot be used.
Result<OpenedRecording> open_recording(const std::vector<std::string>& inputs,
                                       const std::optional<std::filesystem::path>& configuration);

/// The same for raw dumps and a configuration at hand.
Result<OpenedRecording> open_dumps(const std::vector<std::string>& inputs, Configuration configuration);

}  // namespace imuscope
