#pragma once

/// Files that are embedded when imuscope is built (src/report/embed_assets.cmake).

#include <string_view>

namespace imuscope::view {

std::string_view page_template();
std::string_view page_kit();
std::string_view page_style();
std::string_view page_script();

}  // namespace imuscope::view
