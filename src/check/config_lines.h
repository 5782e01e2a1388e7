#pragma once

/// A configuration with some of its lines corrected.

#include <string>
#include <vector>

#include "base/result.h"
#include "check/finding.h"

namespace imuscope::check {

/// The text with these lines in place of those that had their keys, or added to their tables; everything else
/// stays as it is, comments and order included. The later of two lines of one key counts. Error (kWork): a
/// table that is written in a way that no line can be put into, such as csv = { ... }.
[[nodiscard]] Result<std::string> with_lines(const std::string& toml, const std::vector<ConfigLine>& lines);

/// All lines that findings ask for.
[[nodiscard]] std::vector<ConfigLine> lines_of(const std::vector<Finding>& findings);

}  // namespace imuscope::check
