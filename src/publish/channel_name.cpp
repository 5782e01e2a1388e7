#include "publish/channel_name.h"

#include <algorithm>
#include <cctype>

namespace imuscope {

std::string channel_name(std::string_view prefix, std::string_view kind, std::string_view device) {
  constexpr std::size_t kMaxLength = 63;  // LCM_MAX_CHANNEL_NAME_LENGTH
  std::string name(prefix);
  name.append("_").append(kind);
  if (!device.empty()) name += '_';
  for (const char c : device) {
    const auto letter = static_cast<unsigned char>(c);
    name += std::isalnum(letter) != 0 ? static_cast<char>(std::toupper(letter)) : '_';
  }
  name.resize(std::min(name.size(), kMaxLength));
  return name;
}

}  // namespace imuscope
