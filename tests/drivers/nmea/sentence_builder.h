#pragma once

/// Builds NMEA sentences for tests, written from the protocol's layout and not from the decoder.

#include <string>
#include <string_view>

namespace imuscope::test {

/// @param content  what stands between '$' and '*'
inline std::string sentence(const std::string& content) {
  unsigned sum = 0;
  for (const char c : content) sum ^= static_cast<unsigned char>(c);
  constexpr std::string_view kHex = "0123456789ABCDEF";
  return "$" + content + "*" + kHex[sum >> 4U] + kHex[sum & 0xFU] + "\r\n";
}

}  // namespace imuscope::test
