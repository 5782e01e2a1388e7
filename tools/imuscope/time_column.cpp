#include "time_column.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <deque>

#include "base/utc_text.h"

namespace imuscope::cli {
namespace {

/// Quartz and rounded stamps stay within; the next wrong rate that people type is further away.
constexpr double kRateTolerance = 0.005;
/// A row that comes later than so many periods has a hole before it, or is the first of a late burst.
constexpr double kHole = 1.5;
/// Rows by which a burst may delay its first one.
constexpr std::size_t kBurst = 32;

bool is_one_of(std::string_view name, std::span<const std::string_view> names) {
  std::string lower(name);
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return std::find(names.begin(), names.end(), lower) != names.end();
}

double median_of(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Time from a row to the next, per sample where a counter tells how many it is.
std::vector<double> steps_of(std::span<const double> stamps_s, std::span<const std::int64_t> counts) {
  std::vector<double> steps(stamps_s.size() - 1);
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const double samples = counts.empty() ? 1.0 : static_cast<double>(counts[i + 1] - counts[i]);
    steps[i] = (stamps_s[i + 1] - stamps_s[i]) / std::max(1.0, samples);
  }
  return steps;
}

/// Rows that arrive in bursts: many steps are longer than the middle one, where lost samples make few so.
bool are_bursts(const std::vector<double>& steps, double median) {
  constexpr double kMostLost = 0.08;
  constexpr double kLeastEven = 0.7;
  const auto n = static_cast<double>(steps.size());
  const auto longer =
      std::count_if(steps.begin(), steps.end(), [&](double step) { return step > kHole * median; });
  const auto shorter =
      std::count_if(steps.begin(), steps.end(), [&](double step) { return step < (2.0 - kHole) * median; });
  return median <= 0.0 || static_cast<double>(longer) > kMostLost * n ||
         static_cast<double>(longer + shorter) > (1.0 - kLeastEven) * n;
}

/// The period: the mean of the steps that are one, or over bursts of rows the median of what each makes.
double period_of(std::span<const double> stamps_s, const std::vector<double>& steps) {
  const double median = median_of(steps);
  if (are_bursts(steps, median)) {
    std::vector<double> bursts;
    for (std::size_t i = 0; i + kBurst < stamps_s.size(); i += kBurst)
      bursts.push_back((stamps_s[i + kBurst] - stamps_s[i]) / static_cast<double>(kBurst));
    return bursts.empty() ? median : median_of(bursts);
  }
  double sum = 0.0;
  std::size_t n = 0;
  for (const double step : steps) {
    if (step > kHole * median) continue;
    sum += step;
    ++n;
  }
  return sum / static_cast<double>(n);
}

/// Samples missing before every row: by how many periods it and the rows after it are late.
std::vector<std::int64_t> holes_of(std::span<const double> stamps_s, double period_s) {
  std::vector<std::int64_t> missing(stamps_s.size(), 0);
  const auto lateness = [&](std::size_t i) {
    return stamps_s[i] - stamps_s[0] - static_cast<double>(i) * period_s;
  };
  std::deque<std::size_t> smallest;  // rows ahead, by rising lateness: the front is the least of the window
  std::size_t next = 0;
  double before = 0.0;
  for (std::size_t i = 0; i < stamps_s.size(); ++i) {
    for (; next < stamps_s.size() && next < i + kBurst; ++next) {
      while (!smallest.empty() && lateness(smallest.back()) >= lateness(next)) smallest.pop_back();
      smallest.push_back(next);
    }
    while (smallest.front() < i) smallest.pop_front();
    const double now = lateness(smallest.front());
    if (i > 0 && now - before > (kHole - 1.0) * period_s)
      missing[i] = std::llround((now - before) / period_s);
    before = now;
  }
  return missing;
}

}  // namespace

std::optional<double> parse_stamp(std::string_view text) {
  if (text.size() > 1 && text.front() == '"' && text.back() == '"') text = text.substr(1, text.size() - 2);
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error == std::errc() && end == text.data() + text.size() && std::isfinite(value)) return value;
  const auto utc = parse_utc_text(text);
  return utc ? std::optional(utc->since_1970_s) : std::nullopt;
}

bool is_time_name(std::string_view name) {
  constexpr std::array<std::string_view, 10> kNames{"time_s",   "time",      "timestamp", "time_utc",
                                                    "utc",      "t_s",       "utc_time",  "timestamp_s",
                                                    "datetime", "time_utc_s"};
  return is_one_of(name, kNames);
}

bool is_week_name(std::string_view name) {
  constexpr std::array<std::string_view, 3> kNames{"gps_week", "gpsweek", "week"};
  return is_one_of(name, kNames);
}

bool is_week_seconds_name(std::string_view name) {
  constexpr std::array<std::string_view, 8> kNames{
      "gps_tow", "tow", "tow_s", "gps_seconds", "gpssec", "gps_seconds_of_week", "sow", "gps_tow_s"};
  return is_one_of(name, kNames);
}

Result<StampedRows> rows_of_stamps(std::span<const double> stamps_s, std::span<const std::int64_t> counts,
                                   std::optional<double> rate_hz, std::size_t first_row) {
  constexpr std::size_t kFewest = 3;
  if (stamps_s.size() < kFewest) {
    return work_error(fmt::format("{} time stamps tell no rate", stamps_s.size()),
                      "leave the times out (--time none)");
  }
  for (std::size_t i = 1; i < stamps_s.size(); ++i) {
    if (stamps_s[i] >= stamps_s[i - 1]) continue;
    return work_error(fmt::format("the time goes back, from {:.6f} to {:.6f}, at row {}", stamps_s[i - 1],
                                  stamps_s[i], first_row + i + 1),
                      "sort the rows, or leave the times out (--time none)");
  }
  const auto steps = steps_of(stamps_s, counts);
  const double period_s = period_of(stamps_s, steps);
  if (!(period_s > 0.0)) {
    return work_error("the time stamps do not move on", "leave the times out (--time none)");
  }
  // Enough digits for any clock, and none of the stamps' own rounding.
  const double fits_hz = std::stod(fmt::format("{:.6g}", 1.0 / period_s));
  if (rate_hz && std::abs(*rate_hz * period_s - 1.0) > kRateTolerance) {
    return usage_error(fmt::format("--rate {:g} contradicts the time stamps, whose rows are {:.6g} s apart",
                                   *rate_hz, period_s),
                       fmt::format("--rate {:g} fits", fits_hz));
  }
  StampedRows rows;
  rows.rate_hz = rate_hz.value_or(fits_hz);
  rows.missing_before =
      counts.empty() ? holes_of(stamps_s, period_s) : std::vector<std::int64_t>(stamps_s.size(), 0);
  return rows;
}

}  // namespace imuscope::cli
