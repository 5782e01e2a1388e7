#pragma once

/// The tables of a run folder: their columns with units and meaning. Whoever writes one takes its header from
/// here, whoever reads one its units: navigation.csv, odometry.csv, calibration_NAME.csv, errors_NAME.csv,
/// scatter_NAME.csv, smoothed_navigation.csv, smoothed_NAME.csv.

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"

namespace imuscope::tables {

/// What the cells of a column are. Every cell may be empty: not known.
enum class CellKind : std::uint8_t {
  kNumber,
  kText,  ///< one of a few words
};

/// One column: how it is called, in what it is measured, what it means.
struct Column {
  std::string name;
  std::string unit;  ///< "m/s^2", "deg", ...; "1" without a dimension; empty for text
  std::string description;
  CellKind kind = CellKind::kNumber;
};

/// One kind of file: of the run, or one for every device.
struct TableKind {
  std::string stem;  ///< "navigation", "errors"
  bool is_per_device = false;
  std::string description;
  std::vector<Column> columns;
};

const std::vector<TableKind>& run_tables();

/// @param stem  of one that exists: "navigation", "odometry", "calibration", "errors", "scatter", "smoothed",
///              "smoothed_navigation"
const TableKind& run_table(std::string_view stem);

/// Names of the columns, with commas between them and a newline at the end.
std::string csv_header(const TableKind& table);

/// A file of a run folder, by its name.
struct TableFile {
  const TableKind* kind = nullptr;
  std::string device;  ///< empty for a file of the run
};

/// Nothing for what is no table of a run, and for a device whose name is none.
std::optional<TableFile> table_file(std::string_view file_name);

/// The unit that a name of ours ends in: "m/s^2" of "ba_x_mps2", "deg" of "boresight_sd_deg", "s" of "t_d_s".
/// Empty where the name has none.
std::string_view unit_in_name(std::string_view name);

}  // namespace imuscope::tables
