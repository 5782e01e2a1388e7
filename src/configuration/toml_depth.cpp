#include "configuration/toml_depth.h"

#include <algorithm>

namespace imuscope {
namespace {

/// Takes a string off the front of `rest`, which begins with its quote, up to and with its end; of one that
/// does not end, everything.
void skip_string(std::string_view& rest) {
  const char quote = rest.front();
  const bool has_escapes = quote == '"';
  const bool has_lines = rest.size() >= 3 && rest[1] == quote && rest[2] == quote;
  const std::string_view end = rest.substr(0, has_lines ? 3 : 1);
  std::size_t at = end.size();
  while (at < rest.size() && !rest.substr(at).starts_with(end)) {
    if (!has_lines && rest[at] == '\n') break;
    at += has_escapes && rest[at] == '\\' ? 2 : 1;
  }
  rest.remove_prefix(std::min(at + end.size(), rest.size()));
}

}  // namespace

bool has_key_too_deep(std::string_view document) {
  std::size_t n_words = 1;
  while (!document.empty()) {
    const char c = document.front();
    if (c == '"' || c == '\'') {
      skip_string(document);
      continue;
    }
    if (c == '#') {
      document.remove_prefix(std::min(document.find('\n'), document.size()));
      continue;
    }
    if (c == '.' && ++n_words > kTomlDepthMax) return true;
    constexpr std::string_view kNoKey = "\n=,{}[]";
    if (kNoKey.find(c) != std::string_view::npos) n_words = 1;
    document.remove_prefix(1);
  }
  return false;
}

}  // namespace imuscope
