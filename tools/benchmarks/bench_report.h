#pragma once

/// What every benchmark program says: rows in which a ratio comes first and absolute times are information.
/// One row is one claim; `tools/bench` makes one table and one JSON of all programs' rows.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace bench {

/// A number that a row is held against: its ratio, or where only that was promised, its absolute measurement.
struct Goal {
  enum class Side : std::uint8_t { kAtMost, kAtLeast };
  enum class Of : std::uint8_t { kRatio, kValue };
  Side side = Side::kAtMost;
  double value = 0.0;
  Of of = Of::kRatio;
};

struct Row {
  std::string group;    ///< "decoding", "ring", "epoch", ...: the table's order is that of the first rows
  std::string what;     ///< what was measured, unique within its group
  double ratio = 0.0;   ///< NaN where the row has nothing to be held against
  std::string against;  ///< what the ratio means, in words: "x the checksum alone"
  std::optional<Goal> goal;
  double value = 0.0;               ///< the absolute measurement
  std::string unit;                 ///< of value and reference
  std::optional<double> reference;  ///< the other side of the ratio, measured in the same run
  std::optional<double> memory_mb;  ///< most memory taken beyond what was held before
};

inline constexpr const char* kSchema = "imuscope.bench/1";

/// Writes `{"schema", "rows": [...]}`, unknown numbers as null. False where the file cannot be written.
[[nodiscard]] bool write_rows(const std::filesystem::path& file, const std::vector<Row>& rows);

/// Reads what write_rows() or tools/latency wrote. Throws std::runtime_error that says which file and what is
/// wrong with it.
[[nodiscard]] std::vector<Row> read_rows(const std::filesystem::path& file);

/// The end of every benchmark program: the table on stdout, and the rows in `json` unless that is empty.
/// @return exit code of the program
[[nodiscard]] int finish(const std::vector<Row>& rows, const std::string& json);

/// Prints rows as a table for people, ratios first.
void print_rows(const std::vector<Row>& rows);

/// True where the goal holds; a row without a goal has nothing to miss.
[[nodiscard]] bool meets_goal(const Row& row);

[[nodiscard]] double median(std::vector<double> values);

/// Slope of log(cost) over log(size) by least squares: 1 for a cost that doubles with the size.
/// Precondition: two points or more, all positive.
[[nodiscard]] double growth_exponent(const std::vector<double>& sizes, const std::vector<double>& costs);

/// How the cost grows: the exponent as the ratio, the growth at each doubling as the value.
/// @param goal  the exponent at most
[[nodiscard]] Row growth_row(std::string what, const std::vector<double>& sizes,
                             const std::vector<double>& costs, double goal);

/// Most memory that `job` held beyond what the process held before it, MB. 0 where the kernel does not tell.
[[nodiscard]] double peak_memory_mb(const std::function<void()>& job);

/// Processor time of this thread, seconds: what other programs do does not count.
[[nodiscard]] double processor_time_s();

}  // namespace bench
