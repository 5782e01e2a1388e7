#pragma once

/// Colours of a terminal for the words that say whether all is well. The words alone say the same.

#include <string>

namespace imuscope::top {

/// Whether whoever reads standard output wants colours: it is a terminal that has them, and NO_COLOR is not
/// set (https://no-color.org).
[[nodiscard]] bool colours_wanted();

/// A line of lines_of() with the sequences of ECMA-48 in it: headings bold, states green, yellow or red.
[[nodiscard]] std::string coloured(const std::string& line);

}  // namespace imuscope::top
