#pragma once

/// How channels are named, on the bus and in captures.

#include <string>
#include <string_view>

namespace imuscope {

/// What every channel begins with, unless configured otherwise.
inline constexpr std::string_view kDefaultChannelPrefix = "IMUSCOPE";

/// PREFIX_KIND, or PREFIX_KIND_DEVICE where the kind exists per device. The device's name appears in upper
/// case, with '_' for every character but letters and digits: IMUSCOPE_ERROR_MTX1. At most 63 characters,
/// which is what LCM permits; what is longer is cut.
[[nodiscard]] std::string channel_name(std::string_view prefix, std::string_view kind,
                                       std::string_view device = {});

}  // namespace imuscope
