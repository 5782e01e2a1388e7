#include "stream_protocols.h"

#include <array>

namespace imuscope::cli {

std::span<const StreamProtocol> stream_protocols() {
  static constexpr auto kProtocols = std::to_array<StreamProtocol>({
      {"xsens_mt", decode_xsens_mt, false},
      {"ixblue_stdbin", decode_ixblue_stdbin, false},
      {"nmea", decode_nmea, true},
      {"ubx", decode_ubx, true},
      {"greis", decode_greis, false},
      {"rtklib_pos", decode_rtklib_pos, false},
      {"candump", decode_candump_frames, false},
  });
  return kProtocols;
}

std::string hex(std::span<const std::uint8_t> bytes) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text;
  text.reserve(2 * bytes.size());
  for (const std::uint8_t byte : bytes) {
    text += kDigits[byte >> 4U];
    text += kDigits[byte & 0xFU];
  }
  return text;
}

}  // namespace imuscope::cli
