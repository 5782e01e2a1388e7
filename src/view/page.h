#pragma once

/// The page itself, whole: HTML with its style and script in it. Nothing of it comes from elsewhere.

#include <string>

namespace imuscope::view {

[[nodiscard]] std::string page_html();

}  // namespace imuscope::view
