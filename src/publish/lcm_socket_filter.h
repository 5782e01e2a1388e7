#pragma once

/// Keeps what nobody here asked for away from a socket that hears an LCM bus: the kernel drops it, without a
/// wake-up of this process.

#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"

namespace imuscope {

/// Whose datagrams a socket hears.
enum class Reach { kThisPc, kNetwork };

/// Which channels of an LCM bus are wanted: one whole name, or every name with this beginning.
struct ChannelPattern {
  std::string text;
  bool any_ending = false;

  [[nodiscard]] bool matches(std::string_view channel) const {
    return any_ending ? channel.starts_with(text) : channel == text;
  }
};

/// Lets only whole messages (LC02) on these channels through to a UDP socket. Everything else, fragments of
/// long messages above all, is dropped by the kernel and counted in /proc/net/udp. With kThisPc a datagram
/// must have been sent on this PC, which the kernel knows by the way it came, not by an address that a
/// sender may choose.
/// @param channels  none: nothing passes
/// @return an error of kind kWork where the kernel refuses; what was attached before then stays
[[nodiscard]] Result<void> attach_lcm_filter(int socket, const std::vector<ChannelPattern>& channels,
                                             Reach reach);

}  // namespace imuscope
