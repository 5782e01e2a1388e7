#include "drivers/rtklib_pos/messages.h"

#include <cmath>

#include "drivers/device/calendar.h"
#include "drivers/device/decimal.h"
#include "sample/gps_time.h"

namespace imuscope::rtklib_pos {
namespace {

constexpr std::int64_t kSecondsPerDayInt = 86'400;
constexpr double kMinutesPerDegree = 60.0;
constexpr double kSecondsPerDegree = 3600.0;

std::string_view trimmed(std::string_view text) noexcept {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t' || text.back() == '\r')) {
    text.remove_suffix(1);
  }
  return text;
}

/// Hands out the cells of a line.
class Cells {
 public:
  Cells(std::string_view line, char separator) noexcept : rest_(trimmed(line)), separator_(separator) {}

  std::string_view next() noexcept {
    const std::size_t end = std::min(rest_.find(separator_), rest_.size());
    const std::string_view cell = rest_.substr(0, end);
    rest_.remove_prefix(std::min(end + 1, rest_.size()));
    if (separator_ == ' ') rest_ = trimmed(rest_);
    return trimmed(cell);
  }

  /// False where the cell is not a number.
  bool next(double& value) noexcept {
    const auto number = read_decimal(next());
    value = number.value_or(0.0);
    return number.has_value();
  }
  bool next(std::array<double, 3>& values) noexcept {
    return next(values[0]) && next(values[1]) && next(values[2]);
  }

 private:
  std::string_view rest_;
  char separator_;
};

std::int64_t to_ns(double seconds) noexcept {
  return static_cast<std::int64_t>(std::llround(seconds * static_cast<double>(kNsPerSecond)));
}

/// "2026/03/14" and "12:34:56.100".
std::optional<std::int64_t> calendar_time(std::string_view date, std::string_view time) noexcept {
  const std::size_t slash = date.find('/');
  const std::size_t second_slash = date.find('/', slash + 1);
  const std::size_t colon = time.find(':');
  const std::size_t second_colon = time.find(':', colon + 1);
  if (second_slash == std::string_view::npos || second_colon == std::string_view::npos) return std::nullopt;
  const auto year = read_integer<int>(date.substr(0, slash));
  const auto month = read_integer<unsigned>(date.substr(slash + 1, second_slash - slash - 1));
  const auto day = read_integer<unsigned>(date.substr(second_slash + 1));
  const auto hour = read_integer<int>(time.substr(0, colon));
  const auto minute = read_integer<int>(time.substr(colon + 1, second_colon - colon - 1));
  const auto second = read_decimal(time.substr(second_colon + 1));
  if (!year || !month || !day || !hour || !minute || !second) return std::nullopt;
  const auto days = days_since_1970(*year, *month, *day);
  const bool possible =
      days && *hour >= 0 && *hour < 24 && *minute >= 0 && *minute < 60 && *second >= 0.0 && *second < 61.0;
  if (!possible) return std::nullopt;
  return (*days * kSecondsPerDayInt + *hour * 3600 + *minute * 60) * kNsPerSecond + to_ns(*second);
}

std::optional<std::int64_t> week_time(std::string_view week_text, std::string_view tow_text) noexcept {
  constexpr double kSecondsPerWeek = 604'800.0;
  const auto week = read_integer<std::int64_t>(week_text);
  const auto tow_s = read_decimal(tow_text);
  constexpr std::int64_t kWeekMax = 10'000;
  if (!week || !tow_s || *week < 0 || *week > kWeekMax || *tow_s < 0.0 || *tow_s > kSecondsPerWeek) {
    return std::nullopt;
  }
  return (kGpsEpochDays + 7 * *week) * kSecondsPerDayInt * kNsPerSecond + to_ns(*tow_s);
}

/// "yyyy/mm/dd hh:mm:ss.sss", which holds a blank whatever the separator, or "week tow".
std::optional<std::int64_t> read_time(Cells& cells) noexcept {
  const std::string_view first = cells.next();
  if (first.find('/') == std::string_view::npos) return week_time(first, cells.next());
  const std::size_t blank = first.find(' ');
  if (blank == std::string_view::npos) return calendar_time(first, cells.next());
  return calendar_time(first.substr(0, blank), trimmed(first.substr(blank)));
}

/// Degrees, minutes, seconds; the sign stands before the degrees.
bool read_dms(Cells& cells, double& degrees) noexcept {
  const std::string_view first = cells.next();
  double minutes = 0.0;
  double seconds = 0.0;
  const auto whole = read_decimal(first);
  if (!whole || !cells.next(minutes) || !cells.next(seconds)) return false;
  const double size = std::abs(*whole) + minutes / kMinutesPerDegree + seconds / kSecondsPerDegree;
  degrees = first.front() == '-' ? -size : size;
  return true;
}

bool read_coordinates(Cells& cells, Layout layout, std::array<double, 3>& coordinates) noexcept {
  if (layout != Layout::kLlhDms) return cells.next(coordinates);
  return read_dms(cells, coordinates[0]) && read_dms(cells, coordinates[1]) && cells.next(coordinates[2]);
}

std::array<double, 3> squared_with_sign(const std::array<double, 3>& values) noexcept {
  return {values[0] * std::abs(values[0]), values[1] * std::abs(values[1]), values[2] * std::abs(values[2])};
}

}  // namespace

bool read_comment(std::string_view line, Format& format, std::optional<ReferencePosition>& base) noexcept {
  const auto has = [line](std::string_view word) { return line.find(word) != std::string_view::npos; };
  if (has("ref pos")) {
    Cells cells(line.substr(std::min(line.find(':') + 1, line.size())), ' ');
    std::array<double, 3> place{};
    if (cells.next(place)) base = ReferencePosition{place[0], place[1], place[2]};
    return false;
  }
  if (has("ellipsoidal") || has("geodetic")) format.geodetic_height = has("geodetic");

  std::optional<Layout> layout;
  if (has("latitude(deg)")) layout = Layout::kLlh;
  if (has("latitude(d'\")")) layout = Layout::kLlhDms;
  if (has("x-ecef(m)")) layout = Layout::kXyz;
  if (has("e-baseline(m)")) layout = Layout::kEnu;
  if (!layout) return false;
  format.layout = *layout;
  for (const auto& [word, system] : {std::pair{std::string_view("GPST"), TimeSystem::kGpst},
                                     std::pair{std::string_view("UTC"), TimeSystem::kUtc},
                                     std::pair{std::string_view("JST"), TimeSystem::kJst}}) {
    const std::size_t at = line.find(word);
    if (at == std::string_view::npos) continue;
    format.time_system = system;
    // The word is padded with blanks up to the separator, where that is none.
    const std::size_t behind = line.find_first_not_of(' ', at + word.size());
    const char next = behind == std::string_view::npos ? ' ' : line[behind];
    format.separator = next == ',' || next == ';' || next == '\t' ? next : ' ';
    break;
  }
  format.has_velocity = has("vn(m/s)") || has("vx(m/s)") || has("ve(m/s)");
  return true;
}

std::optional<Solution> parse_solution(std::string_view line, const Format& format) noexcept {
  Cells cells(line, format.separator);
  Solution solution{};
  const auto time = read_time(cells);
  if (!time) return std::nullopt;
  solution.time_ns = *time;
  double q = 0.0;
  double ns = 0.0;
  std::array<double, 3> sd{};
  std::array<double, 3> cross{};
  if (!read_coordinates(cells, format.layout, solution.coordinates) || !cells.next(q) || !cells.next(ns) ||
      !cells.next(sd) || !cells.next(cross) || !cells.next(solution.age_s) || !cells.next(solution.ratio)) {
    return std::nullopt;
  }
  constexpr double kSmallNumberMax = 1000.0;
  if (q < 0.0 || q > kSmallNumberMax || ns < 0.0 || ns > kSmallNumberMax) return std::nullopt;
  solution.q = static_cast<int>(q);
  solution.ns = static_cast<int>(ns);
  solution.variance = squared_with_sign(sd);
  // A cross term is sign(c) sqrt(|c|).
  solution.covariance = squared_with_sign(cross);
  if (format.has_velocity && !(cells.next(solution.velocity) && cells.next(solution.velocity_sd))) {
    return std::nullopt;
  }
  return solution;
}

}  // namespace imuscope::rtklib_pos
