#pragma once

/// A limit that toml++ does not have: it builds and takes down a table for every dot of a key, one inside the
/// other on the stack.

#include <cstddef>
#include <string_view>

namespace imuscope {

/// Deepest key of a configuration: "device.xsens_can.ids.delta_v" has four words.
inline constexpr std::size_t kTomlDepthMax = 64;

/// Whether a key anywhere in the document has more than kTomlDepthMax words. What is no TOML is for the
/// parser to tell.
[[nodiscard]] bool has_key_too_deep(std::string_view document);

}  // namespace imuscope
