#pragma once

/// The recordings that a command is given.

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "base/result.h"
#include "service/recording/recording.h"

namespace imuscope::cli {

/// INPUT... and --config of a command that reads a recording.
void add_inputs(CLI::App& command, std::vector<std::string>& inputs, std::string& config);

/// Opens them with a bar of progress and logs what is remarkable about them.
/// @param config  empty: a capture's own
[[nodiscard]] Result<OpenedRecording> open_inputs(const std::vector<std::string>& inputs,
                                                  const std::string& config);

/// The same, and looks at the data before anything is estimated from them: what it finds is in the recording, is
/// the explanation of an error, and is printed.
/// @param quiet  nothing is printed
[[nodiscard]] Result<OpenedRecording> open_and_look(const std::vector<std::string>& inputs,
                                                    const std::string& config, bool quiet);

}  // namespace imuscope::cli
