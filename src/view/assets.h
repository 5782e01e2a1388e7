#pragma once

/// The live page's own files, embedded when imuscope is built.

#include <string_view>

namespace imuscope::view {

std::string_view page_template();
std::string_view page_style();
std::string_view page_script();

}  // namespace imuscope::view
