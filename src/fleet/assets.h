#pragma once

/// Files of this folder that are part of the program, embedded when it is built.

#include <string_view>

namespace imuscope::fleet {

std::string_view schema();       ///< schema.sql
std::string_view page_style();   ///< page.css, after the kit that all pages share
std::string_view page_script();  ///< page.js

}  // namespace imuscope::fleet
