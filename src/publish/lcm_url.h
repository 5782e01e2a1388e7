#pragma once

/// Which LCM URLs serve: checked before the library gets them, which would print advice of its own to the
/// terminal, abort the process, or write over a file.

#include <cstdint>
#include <string>
#include <string_view>

#include "base/result.h"

namespace imuscope {

/// Multicast that stays on this PC; with ttl=1 it reaches the local network.
inline constexpr std::string_view kDefaultLcmUrl = "udpm://239.255.76.67:7667?ttl=0";

/// What to do about a URL that cannot serve.
inline const std::string kLcmUrlRemedy = "write it as " + std::string(kDefaultLcmUrl);

/// A bus on the network, as its URL tells it.
struct UdpmBus {
  std::uint32_t group = 0;  ///< multicast address, host byte order
  std::uint16_t port = 0;
  std::uint8_t ttl = 0;  ///< 0: on this PC alone
  /// This PC's address on the interface that its routes name for the group, host byte order; 0 where nobody
  /// looked. Another one: the bus lies elsewhere now.
  std::uint32_t local = 0;
};

/// @return an error of kind kUsage for everything but udpm://ADDRESS:PORT?ttl=N, whose parts may be left out
[[nodiscard]] Result<UdpmBus> parse_udpm_url(std::string_view url);

/// Of a bus to hear and to speak on.
/// @return the errors of parse_udpm_url(); one of kind kWork where this PC has no multicast route, with the
///         two commands that make one
[[nodiscard]] Result<UdpmBus> check_lcm_bus(std::string_view url);

/// Of anything to publish into: a bus, or file://PATH?mode=w, an LCM log that is not there yet.
/// @return the errors of check_lcm_bus(); kUsage for a log that exists, which the library would empty, and
///         for what else cannot serve (tcpq's library call aborts the process when the server goes)
[[nodiscard]] Result<void> check_lcm_url(std::string_view url);

}  // namespace imuscope
