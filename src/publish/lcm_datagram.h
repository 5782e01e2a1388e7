#pragma once

/// One datagram of LCM's UDP multicast protocol, as far as imuscope takes it from a network. Of its two kinds
/// only a short message, whole in one datagram, is ever a message of ours (LcmPublisher::kMaxMessageBytes);
/// fragments of long ones claim lengths and offsets of their own and are not read at all. Source: lcm-proj,
/// docs/content/udp-multicast-protocol.md, "LC02".

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

namespace imuscope {

inline constexpr std::uint32_t kShortMessageMagic = 0x4c433032;  ///< "LC02", big-endian
inline constexpr std::size_t kShortHeaderBytes = 8;              ///< magic, sequence number
inline constexpr std::size_t kMaxChannelBytes = 63;              ///< without the terminating zero
/// A UDP datagram over IPv4 carries no more.
inline constexpr std::size_t kMaxDatagramBytes = 65'507;

/// What a datagram holds; valid as long as its bytes.
struct LcmDatagram {
  std::string_view channel;
  std::span<const std::uint8_t> message;
};

/// @return nothing for what is no whole short message
[[nodiscard]] std::optional<LcmDatagram> read_short_message(std::span<const std::uint8_t> datagram);

}  // namespace imuscope
