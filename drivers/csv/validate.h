#pragma once

/// Looks at a CSV file before it is used, so that a mistake is told with file, line and column instead of
/// showing up as missing samples. Non-real-time: allocates, reads files.

#include <filesystem>

#include "base/result.h"
#include "drivers/csv/decoder.h"

namespace imuscope::csv {

/// Reads the whole file once. Fails for a file that cannot be read, that is empty, that lacks a column (the
/// error lists the columns there are and names the nearest), and at the first row with a mistake.
[[nodiscard]] Result<void> validate_file(const std::filesystem::path& file, const ImuConfig& config);
[[nodiscard]] Result<void> validate_file(const std::filesystem::path& file, const GnssConfig& config);

}  // namespace imuscope::csv
