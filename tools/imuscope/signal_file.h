#pragma once

/// A signal from a file: one column of a CSV, or raw little-endian float64 (`.f64`).

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"

namespace imuscope::cli {

struct SignalChoice {
  /// A header name, or a number from 1; may be empty where there is one column only beside times, counter
  /// and what `where` names.
  std::string column;
  std::string where;    ///< "COLUMN=VALUE": rows whose cell is something else count as gaps; may be empty
  std::string counter;  ///< column that counts the samples: numbers left out are gaps; may be empty
  /// Column of time stamps, or WEEK,SECONDS of GPS: times left out are gaps. Empty: a column whose name says
  /// that it holds times, where there is one; "none": no times.
  std::string time{};
  std::optional<double> rate_hz{};  ///< samples per second, to be held against the times
  std::string topic{};              ///< of an MCAP file (message_signal.h), which has no columns
};

struct Signal {
  std::vector<double> values;
  std::vector<std::uint8_t> mask;  ///< 1 = a value; empty: all are
  std::optional<double> rate_hz;   ///< as asked for, or as the times have it; absent where neither tells
};

/// Several columns of one table, read in one go.
struct SignalTable {
  std::vector<std::vector<double>> columns;
  std::vector<std::uint8_t> mask;  ///< of all columns, as Signal::mask
  std::optional<double> rate_hz;   ///< as Signal::rate_hz
};

/// The cells of a line of a CSV file, quotes taken off; empty for an empty line or a comment.
std::vector<std::string> cells_of(std::string_view line);

/// CSV: separated by comma, semicolon, tab or blanks; `#` starts a comment; a first line that is not all
/// numbers is the header. "nan" is a value (the caller decides). Errors (kWork): a missing or empty file, a
/// folder, text where a number belongs (line and column told), a counter that does not rise, times that go
/// back. kUsage: a column that does not exist (columns listed, nearest name suggested), a choice of columns
/// in a raw file, a rate that contradicts the times (with the one that fits).
Result<Signal> read_signal(const std::filesystem::path& file, const SignalChoice& choice);

/// Columns of a CSV file, each as read_signal() would read it, in their order.
/// @param columns  in the place of `choice.column`; at least one
Result<SignalTable> read_signals(const std::filesystem::path& file, const SignalChoice& choice,
                                 const std::vector<std::string>& columns);

}  // namespace imuscope::cli
