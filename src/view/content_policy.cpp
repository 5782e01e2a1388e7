#include "view/content_policy.h"

#include <openssl/evp.h>
#include <array>
#include <cstddef>

namespace imuscope::view {

namespace {

std::string hash_source(std::string_view text) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned size = 0;
  EVP_Digest(text.data(), text.size(), digest.data(), &size, EVP_sha256(), nullptr);
  std::array<unsigned char, 2 * EVP_MAX_MD_SIZE> base64{};
  const int length = EVP_EncodeBlock(base64.data(), digest.data(), static_cast<int>(size));
  return " 'sha256-" +
         std::string(reinterpret_cast<const char*>(base64.data()), static_cast<std::size_t>(length)) + "'";
}

/// Of every element with this tag.
std::string hash_sources(std::string_view page, std::string_view tag) {
  const std::string begin = "<" + std::string(tag) + ">";
  const std::string end = "</" + std::string(tag) + ">";
  std::string sources;
  for (std::size_t at = page.find(begin); at != std::string_view::npos; at = page.find(begin, at)) {
    at += begin.size();
    const std::size_t to = page.find(end, at);
    if (to == std::string_view::npos) break;
    sources += hash_source(page.substr(at, to - at));
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
