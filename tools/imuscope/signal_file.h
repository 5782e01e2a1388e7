#pragma once

/// A signal from a file: one column of a CSV, or raw little-endian float64 (`.f64`).

#include <filesystem>
#include <string>
#include <vector>

#include "base/result.h"

namespace imuscope::cli {

/// CSV: separated by comma, semicolon, tab or blanks; `#` starts a comment; a first line that is not all
/// numbers is the header. `column`: a header name, or a number from 1; may be empty where there is one column
/// only. "nan" is a value (the caller decides). Errors (kWork): a missing or empty file, a folder, text where
/// a number belongs (line and column told). kUsage: a column that does not exist (columns listed, nearest
/// name suggested).
Result<std::vector<double>> read_signal(const std::filesystem::path& file, const std::string& column);

}  // namespace imuscope::cli
