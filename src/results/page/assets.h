#pragma once

/// Styles that pages share, embedded when imuscope is built.

#include <string_view>

namespace imuscope::page {

std::string_view kit_style();       ///< kit.css: of every page
std::string_view document_style();  ///< document.css: of a page that is read, after the kit's

}  // namespace imuscope::page
