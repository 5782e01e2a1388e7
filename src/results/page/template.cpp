#include "results/page/template.h"

#include <fmt/format.h>
#include <openssl/evp.h>

#include <array>
#include <cstddef>

namespace imuscope::page {

std::string filled(std::string_view page_template,
                   const std::vector<std::pair<std::string_view, std::string_view>>& values) {
  constexpr std::string_view kBegin = "{{";
  constexpr std::string_view kEnd = "}}";
  std::string page;
  while (!page_template.empty()) {
    const std::size_t begin = page_template.find(kBegin);
    page += page_template.substr(0, begin);
    if (begin == std::string_view::npos) break;
    const std::size_t end = page_template.find(kEnd, begin);
    if (end == std::string_view::npos) {
      page += page_template.substr(begin);
      break;
    }
    const std::string_view name = page_template.substr(begin + kBegin.size(), end - begin - kBegin.size());
    for (const auto& [key, value] : values) {
      if (key == name) page += value;
    }
    page_template.remove_prefix(end + kEnd.size());
  }
  return page;
}

std::string hash_source(std::string_view text) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int size = 0;
  EVP_Digest(text.data(), text.size(), digest.data(), &size, EVP_sha256(), nullptr);
  std::array<unsigned char, 2 * EVP_MAX_MD_SIZE> base64{};
  const int length = EVP_EncodeBlock(base64.data(), digest.data(), static_cast<int>(size));
  return fmt::format("'sha256-{}'", std::string_view(reinterpret_cast<const char*>(base64.data()),
                                                     static_cast<std::size_t>(length)));
}

}  // namespace imuscope::page
