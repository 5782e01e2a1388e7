#include "publish/lcm_datagram.h"

#include <algorithm>

namespace imuscope {

std::optional<LcmDatagram> read_short_message(std::span<const std::uint8_t> datagram) {
  if (datagram.size() < kShortHeaderBytes || datagram.size() > kMaxDatagramBytes) return std::nullopt;
  std::uint32_t magic = 0;
  for (std::size_t i = 0; i < sizeof magic; ++i) magic = magic << 8U | datagram[i];
  if (magic != kShortMessageMagic) return std::nullopt;
  const auto text = datagram.subspan(kShortHeaderBytes);
  const auto searched = text.first(std::min(text.size(), kMaxChannelBytes + 1));
  const auto zero = std::find(searched.begin(), searched.end(), std::uint8_t{0});
  if (zero == searched.end()) return std::nullopt;
  const auto length = static_cast<std::size_t>(zero - searched.begin());
  return LcmDatagram{{reinterpret_cast<const char*>(text.data()), length}, text.subspan(length + 1)};
}

}  // namespace imuscope
