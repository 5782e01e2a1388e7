#pragma once

/// How the log looks: for a person at a terminal, or for systemd's journal.

#include <string_view>

namespace imuscope::cli {

/// The log goes to standard error, "17:03:21.250 warning mtx1: ...", or to the journal where that is the
/// journal.
void set_up_log();

/// What a line of an error begins with besides its text.
[[nodiscard]] std::string_view error_prefix();

}  // namespace imuscope::cli
