#pragma once

/// Time stamps of a table: seconds, ISO 8601, or GPS week and seconds of the week; and what they say of the
/// samples: their rate, and how many are missing before each row.

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"

namespace imuscope::cli {

/// Seconds of "12.5" (any origin), or of "2026-11-23T07:38:36.125Z" with or without zone, since 1970. Absent
/// where it is neither.
std::optional<double> parse_stamp(std::string_view text);

/// A column by name that holds times as it is: "time_s", "time", "timestamp", "utc" ...
bool is_time_name(std::string_view name);
/// GPS weeks ("gps_week", "week") and the seconds in them ("tow", "gps_tow", "tow_s" ...).
bool is_week_name(std::string_view name);
bool is_week_seconds_name(std::string_view name);

struct StampedRows {
  double rate_hz = 0.0;
  std::vector<std::int64_t> missing_before;  ///< one a row
};

/// Stamps may be late by as much as a burst of rows is long (arrival times): what counts is by how much all
/// the next rows are late. `counts` are the rows' sample numbers where a counter tells them, else empty; then
/// nothing is missing beside what the counter says.
/// `first_row` is the number of the first one in what is read, for messages.
/// Errors (kWork): fewer than three rows, a stamp that goes back (with its row, counted from 1), no rate to
/// be had. kUsage: `rate_hz`, where given, contradicts the stamps, with the one that fits.
Result<StampedRows> rows_of_stamps(std::span<const double> stamps_s, std::span<const std::int64_t> counts,
                                   std::optional<double> rate_hz, std::size_t first_row = 0);

}  // namespace imuscope::cli
