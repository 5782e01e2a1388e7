#pragma once

/// Which LCM URLs serve, asked before the library is, which would print advice of its own to the terminal.

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "base/result.h"

namespace imuscope {

/// Multicast that stays on this PC; with ttl=1 it reaches the local network.
inline constexpr std::string_view kDefaultLcmUrl = "udpm://239.255.76.67:7667?ttl=0";

/// What to do about a URL that cannot serve.
inline const std::string kLcmUrlRemedy = "write it as " + std::string(kDefaultLcmUrl);

/// @return an error of kind kUsage for a URL that cannot serve (tcpq is refused: its library call aborts the
///         process when the server goes), of kind kWork where this PC has no multicast route, with the two
///         commands that make one
[[nodiscard]] Result<void> check_lcm_url(std::string_view url);

/// Port of a udpm URL that check_lcm_url() does not call wrong; nothing for the others.
[[nodiscard]] std::optional<std::uint16_t> udpm_port(std::string_view url);

}  // namespace imuscope
