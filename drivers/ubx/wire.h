#pragma once

/// u-blox UBX as it stands on the wire: B5 62, class, id, length u16, payload, two checksum bytes. Numbers
/// least significant byte first.

#include <cstddef>
#include <cstdint>

namespace imuscope::ubx {

inline constexpr std::uint8_t kSync1 = 0xB5;
inline constexpr std::uint8_t kSync2 = 0x62;
inline constexpr std::size_t kHeaderSize = 6;
inline constexpr std::size_t kChecksumSize = 2;
/// Raw measurement messages of receivers with many channels come to 2 kB; more is a false start.
inline constexpr std::size_t kPayloadMax = 4096;

inline constexpr std::uint8_t kClassNav = 0x01;
inline constexpr std::uint8_t kIdPvt = 0x07;
inline constexpr std::size_t kPvtMin = 84;  ///< u-blox 7; 92 from u-blox 8 on

}  // namespace imuscope::ubx
