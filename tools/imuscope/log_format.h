#pragma once

/// How the log looks: for a person at a terminal, or for systemd's journal.

#include <string_view>

namespace imuscope::cli {

/// Standard error is connected to the journal, which stamps lines itself and takes their priority from a
/// leading <N>: systemd tells by JOURNAL_STREAM which file that is.
[[nodiscard]] bool logs_to_journal();

/// The log goes to standard error: "17:03:21.250 warning mtx1: ..." for people, "<4>mtx1: ..." for the
/// journal.
void set_up_log();

/// What a line of an error begins with besides its text.
[[nodiscard]] std::string_view error_prefix();

}  // namespace imuscope::cli
