#pragma once

/// How a page is put together from its template, and what it may run.

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace imuscope::page {

/// The template with each {{name}} replaced, in one pass: what is put in is not searched again. A name
/// without a value becomes nothing.
std::string filled(std::string_view page_template,
                   const std::vector<std::pair<std::string_view, std::string_view>>& values);

/// A script or style as a Content-Security-Policy names it, "'sha256-...'": no other is taken, whatever got
/// into the page.
std::string hash_source(std::string_view text);

}  // namespace imuscope::page
