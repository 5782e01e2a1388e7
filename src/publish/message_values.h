#pragma once

/// What the numbers of messages have in common.

#include <chrono>
#include <cstdint>
#include <limits>

#include "base/time.h"

namespace imuscope {

/// A number that nobody knows.
inline constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

/// utime of a message: whole microseconds, rounded down.
[[nodiscard]] constexpr std::int64_t to_utime(UtcTime utc) noexcept {
  return std::chrono::floor<std::chrono::microseconds>(utc).time_since_epoch().count();
}

/// LCM counts arrays in int32.
template <typename Range>
[[nodiscard]] std::int32_t element_count(const Range& range) {
  return static_cast<std::int32_t>(range.size());
}

}  // namespace imuscope
