#pragma once

/// Which times of a recording can be believed.

#include <cstdint>

namespace imuscope {

/// No clock of a PC has counted this far (146 years), and differences of such times fit their type: a stamp
/// beyond is damage.
inline constexpr std::int64_t kStampEnd_ns = std::int64_t{1} << 62U;

constexpr bool is_stamp_ns(std::int64_t ns) { return ns > -kStampEnd_ns && ns < kStampEnd_ns; }

/// The same in microseconds, the unit of LCM's times.
constexpr bool is_stamp_us(std::int64_t us) {
  constexpr std::int64_t kNsPerUs = 1000;
  return us > -kStampEnd_ns / kNsPerUs && us < kStampEnd_ns / kNsPerUs;
}

}  // namespace imuscope
