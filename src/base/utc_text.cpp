#include "base/utc_text.h"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstddef>

#include "base/units.h"

namespace imuscope {
namespace {

constexpr double kSecondsPerMinute = 60.0;

/// Reads `digits` digits at the front of `text` and drops them.
std::optional<int> take_number(std::string_view& text, std::size_t digits) {
  if (text.size() < digits) return std::nullopt;
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + digits, value);
  if (error != std::errc() || end != text.data() + digits || text.front() == '-') return std::nullopt;
  text.remove_prefix(digits);
  return value;
}

bool take_char(std::string_view& text, std::string_view wanted) {
  if (text.empty() || wanted.find(text.front()) == std::string_view::npos) return false;
  text.remove_prefix(1);
  return true;
}

/// Seconds that a zone such as "+01:00", "-0530" or "Z" is ahead of UTC.
std::optional<double> zone_offset_s(std::string_view text) {
  if (text.empty() || text == "Z" || text == "z") return 0.0;
  const double sign = text.front() == '-' ? -1.0 : 1.0;
  if (!take_char(text, "+-")) return std::nullopt;
  const auto hours = take_number(text, 2);
  if (!hours) return std::nullopt;
  const bool has_minutes = take_char(text, ":") || !text.empty();
  const auto minutes = has_minutes ? take_number(text, 2) : std::optional(0);
  if (!minutes || !text.empty() || *hours > 23 || *minutes > 59) return std::nullopt;
  return sign * (kSecondsPerHour * *hours + kSecondsPerMinute * *minutes);
}

struct TimeOfDay {
  int hour = 0;
  int minute = 0;
  double second = 0.0;
};

/// Days since 1970 of "2026-03-14", taken off the front.
std::optional<double> take_days(std::string_view& text) {
  const auto year = take_number(text, 4);
  if (!year || !take_char(text, "-")) return std::nullopt;
  const auto month = take_number(text, 2);
  if (!month || !take_char(text, "-")) return std::nullopt;
  const auto day = take_number(text, 2);
  if (!day) return std::nullopt;
  const std::chrono::year_month_day date{std::chrono::year{*year},
                                         std::chrono::month{static_cast<unsigned>(*month)},
                                         std::chrono::day{static_cast<unsigned>(*day)}};
  if (!date.ok()) return std::nullopt;
  return static_cast<double>(std::chrono::sys_days(date).time_since_epoch().count());
}

/// "09:30:12.25", taken off the front.
std::optional<TimeOfDay> take_time_of_day(std::string_view& text) {
  const auto hour = take_number(text, 2);
  if (!hour || !take_char(text, ":")) return std::nullopt;
  const auto minute = take_number(text, 2);
  if (!minute || !take_char(text, ":")) return std::nullopt;
  const std::size_t length = std::min(text.find_first_not_of("0123456789."), text.size());
  double second = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + length, second);
  constexpr double kLeapSecondEnd = 61.0;
  if (error != std::errc() || end != text.data() + length || *hour > 23 || *minute > 59 ||
      second >= kLeapSecondEnd)
    return std::nullopt;
  text.remove_prefix(length);
  return TimeOfDay{*hour, *minute, second};
}

}  // namespace

std::optional<UtcText> parse_utc_text(std::string_view text) {
  const auto days = take_days(text);
  if (!days || !take_char(text, "Tt ")) return std::nullopt;
  const auto time = take_time_of_day(text);
  const auto zone_s = zone_offset_s(text);
  if (!time || !zone_s) return std::nullopt;
  return UtcText{kSecondsPerDay * *days + kSecondsPerHour * time->hour + kSecondsPerMinute * time->minute +
                     time->second - *zone_s,
                 !text.empty()};
}

}  // namespace imuscope
