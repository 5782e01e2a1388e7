#pragma once

/// Dates and times of day as people and files write them.

#include <optional>
#include <string_view>

namespace imuscope {

struct UtcText {
  double since_1970_s = 0.0;  ///< UTC, leap seconds not counted; to 0.2 us
  bool has_zone = false;      ///< a text that names none is taken for UTC
};

/// Reads ISO 8601: "2026-03-14T09:30:12.25Z", a space for the T, a zone of "+01:00", "-0530" or "+01", or none.
/// Second 60 is a leap second's, and the first of the next minute here.
/// @return nothing where the text is anything else, or no such day or time is
[[nodiscard]] std::optional<UtcText> parse_utc_text(std::string_view text);

}  // namespace imuscope
