#include "view/content_policy.h"

#include <cstddef>

#include "results/page/template.h"

namespace imuscope::view {

namespace {

/// Of every element with this tag.
std::string hash_sources(std::string_view text, std::string_view tag) {
  const std::string begin = "<" + std::string(tag) + ">";
  const std::string end = "</" + std::string(tag) + ">";
  std::string sources;
  for (std::size_t at = text.find(begin); at != std::string_view::npos; at = text.find(begin, at)) {
    at += begin.size();
    const std::size_t to = text.find(end, at);
    if (to == std::string_view::npos) break;
    sources += " " + page::hash_source(text.substr(at, to - at));
    at = to;
  }
  return sources.empty() ? " 'none'" : sources;
}

}  // namespace

std::string content_policy(std::string_view page) {
  return "default-src 'none'; script-src" + hash_sources(page, "script") + "; style-src" +
         hash_sources(page, "style") +
         "; connect-src 'self'; img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
}

}  // namespace imuscope::view
