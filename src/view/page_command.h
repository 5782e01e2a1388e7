#pragma once

/// What a page may ask for: to mark an event, and, of a recording that is played, where and how fast.

#include <string>
#include <string_view>
#include <variant>

#include "base/result.h"

namespace imuscope::view {

/// Longest message that a page sends; a longer one ends its connection.
inline constexpr std::size_t kPageMessageMax = 1024;
/// Longest text of a mark, bytes.
inline constexpr std::size_t kMarkTextMax = 200;

struct Mark {
  std::string text;  ///< one line of UTF-8; "mark" where the page sent none
};
struct Seek {
  double time_s = 0.0;  ///< seconds since the recording's first R-IMU epoch
};
struct Pause {};
struct Play {
  double speed = 1.0;  ///< kSlowest to kFastest
};
inline constexpr double kSlowest = 0.1;
inline constexpr double kFastest = 100.0;

using PageCommand = std::variant<Mark, Seek, Pause, Play>;

/// @param text  JSON of one of {"mark": TEXT}, {"seek_s": NUMBER}, {"pause": true}, {"play": SPEED}
/// @return kUsage for anything else
[[nodiscard]] Result<PageCommand> read_page_command(std::string_view text);

}  // namespace imuscope::view
