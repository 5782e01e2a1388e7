#pragma once

/// The wire of a device that nobody makes: sync AC 3E, sample counter (16 bits), angular rate in rad/s and specific
/// force in m/s^2 (x, y, z; 32-bit floats), sum of the bytes after the sync modulo 256. Little-endian.

#include <cstddef>
#include <cstdint>

namespace imuscope::throwaway {

inline constexpr std::uint8_t kSync1 = 0xAC;
inline constexpr std::uint8_t kSync2 = 0x3E;
inline constexpr std::size_t kSyncSize = 2;
inline constexpr std::size_t kCounterAt = 2;
inline constexpr std::size_t kRateAt = 4;
inline constexpr std::size_t kForceAt = 16;
inline constexpr std::size_t kChecksumAt = 28;
inline constexpr std::size_t kFrameSize = 29;

}  // namespace imuscope::throwaway
