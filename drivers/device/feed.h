#pragma once

/// A read on its way into a scanner that holds less than a read may bring.

#include <cstdint>
#include <span>

#include "base/time.h"

namespace imuscope {

/// Hands all of `bytes` to `scanner` in as many pieces as it takes, and calls `drain` after each.
/// @param scanner  append(bytes, arrival) takes some of them, at least one, and returns how many
template <typename Scanner, typename Drain>
void feed(Scanner& scanner, std::span<const std::uint8_t> bytes, HostTime arrival,
          const Drain& drain) noexcept {
  while (!bytes.empty()) {
    bytes = bytes.subspan(scanner.append(bytes, arrival));
    drain();
  }
}

}  // namespace imuscope
