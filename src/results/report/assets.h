#pragma once

/// The files that make the page, embedded when imuscope is built.

#include <string_view>

namespace imuscope::report {

std::string_view page_template();    ///< page.html, with {{placeholders}}
std::string_view page_style();       ///< page.css: plots, after the kit's styles
std::string_view page_script();      ///< page.js
std::string_view plotting_notice();  ///< licence of the plotting library
std::string_view plotting_style();   ///< dygraph.min.css
std::string_view plotting_script();  ///< dygraph.min.js

}  // namespace imuscope::report
