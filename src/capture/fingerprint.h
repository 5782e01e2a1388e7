#pragma once

/// The type of an encoded LCM message.

#include <cstdint>
#include <span>

#include "base/bytes.h"

namespace imuscope {

/// What an encoded message begins with, or 0 in its place where it is too short.
inline std::int64_t fingerprint_of(std::span<const std::uint8_t> message) noexcept {
  return message.size() < sizeof(std::int64_t) ? 0 : read_be<std::int64_t>(message);
}

}  // namespace imuscope
