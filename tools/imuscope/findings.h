#pragma once

/// What the look at the data found, for the person who started the command.

#include <filesystem>
#include <string>
#include <vector>

#include "base/result.h"
#include "check/finding.h"
#include "service/recording/recording.h"

namespace imuscope::cli {

/// All of them, the greatest harm first.
void print_findings(const std::vector<check::Finding>& findings);

/// The one sentence of them that ends a command; empty where none harms.
[[nodiscard]] std::string harm_in_short(const std::vector<check::Finding>& findings);

/// The look at a capture, with the configuration that it keeps. Nothing is found in one that cannot be opened:
/// whoever studies it is told why.
[[nodiscard]] std::vector<check::Finding> look_at_capture(const std::filesystem::path& capture);

/// The look at what a live run recorded, into its run.json and onto the console; once, and nothing for a folder
/// of another kind of run.
[[nodiscard]] Result<void> look_at_live_run(const std::filesystem::path& run_dir);

/// All findings and the sentence that ends a command which estimates nothing from them.
void print_look(const std::vector<check::Finding>& findings);

/// A failure that a finding explains is told with it.
[[nodiscard]] Error explained(Error error, const std::vector<check::Finding>& findings);

/// Writes a copy of the configuration with the lines that the findings ask for; a file that is there stays.
/// Errors: nothing to correct, a file that is there or cannot be written, a line that cannot be put in.
[[nodiscard]] Result<void> write_fixed(const Configuration& configuration,
                                       const std::vector<check::Finding>& findings,
                                       const std::filesystem::path& out);

}  // namespace imuscope::cli
