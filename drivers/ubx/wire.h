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

// NAV-PVT: valid, flags.
inline constexpr std::uint8_t kValidDate = 1U << 0U;
inline constexpr std::uint8_t kValidTime = 1U << 1U;
inline constexpr std::uint8_t kFixOk = 1U << 0U;
inline constexpr std::uint8_t kDifferential = 1U << 1U;
inline constexpr unsigned kCarrierShift = 6;  ///< two bits: 0 none, 1 float, 2 fixed

// NAV-PVT: fix type.
inline constexpr std::uint8_t kFix3D = 3;
inline constexpr std::uint8_t kFixWithDeadReckoning = 4;

inline constexpr std::int64_t kMsPerWeek = 604'800'000;

}  // namespace imuscope::ubx
