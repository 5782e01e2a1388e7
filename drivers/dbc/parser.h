#pragma once

/// Reads a DBC file. What imuscope has no use for (nodes, attributes, comments, groups) is stepped over; what
/// it uses must be right: a mistake is an error with file, line and reason.

#include <filesystem>
#include <string_view>

#include "base/result.h"
#include "drivers/dbc/database.h"

namespace imuscope::dbc {

/// @param name  stands for the file in messages
Result<Database> parse(std::string_view text, const std::string& name);

/// The whole text of a DBC file, as UTF-8 (files in Latin-1 are converted); an error that says why it cannot
/// be read.
Result<std::string> read_text(const std::filesystem::path& file);

}  // namespace imuscope::dbc
