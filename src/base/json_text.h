#pragma once

/// JSON as text, for files and for people: the only way from a document to text.

#include <nlohmann/json.hpp>
#include <string>

namespace imuscope {

inline constexpr int kJsonOneLine = -1;
inline constexpr int kJsonIndent = 2;

/// The document as text. Never fails: bytes that are no UTF-8 (a file's name may hold some) become U+FFFD,
/// where the library would throw after all the work is done.
[[nodiscard]] inline std::string json_text(const nlohmann::json& document, int indent = kJsonIndent) {
  return document.dump(indent, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace imuscope
