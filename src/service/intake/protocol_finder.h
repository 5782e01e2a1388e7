#pragma once

/// Which protocol a stream of bytes is in, and what it says of its device: for drafting a configuration.

#include <cstdint>
#include <optional>
#include <span>

#include "configuration/config.h"

namespace imuscope {

/// What was recognised in a stream.
struct FoundStream {
  Protocol protocol{};
  std::uint64_t messages = 0;
  std::uint64_t samples = 0;  ///< of what the device is there for: rates and forces, or positions
  double share = 0.0;         ///< of the bytes that belong to its messages
  /// Samples per second by the device's own times; nothing where it only counts, as an XSens MT does.
  std::optional<double> rate_hz;
};

/// The protocol of a stream: the one with samples whose messages cover the most bytes; nothing where no
/// protocol finds kMessagesToBelieve messages.
[[nodiscard]] std::optional<FoundStream> find_protocol(std::span<const std::uint8_t> bytes);

inline constexpr std::uint64_t kMessagesToBelieve = 3;

}  // namespace imuscope
