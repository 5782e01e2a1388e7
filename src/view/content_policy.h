#pragma once

/// Which scripts and styles a browser may run for a page: its own, by their hashes.

#include <string>
#include <string_view>

namespace imuscope::view {

/// Value of the header Content-Security-Policy.
/// @param page  HTML in which <script> and <style> have no attributes
[[nodiscard]] std::string content_policy(std::string_view page);

}  // namespace imuscope::view
