#pragma once

/// Reads the CSV files that a run writes, row by row: a header, commas, no quotes.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"

namespace imuscope::tables {

class CsvReader {
 public:
  /// Opens the file and finds `columns` in its header. Error: not readable, or a column is missing.
  static Result<CsvReader> open(const std::filesystem::path& file, const std::vector<std::string>& columns);

  /// Goes to the next row. False at the end of the file. A row cut short (a run that was killed) ends it too.
  bool next();

  /// Where the row under way begins in the file; its end where there is none.
  [[nodiscard]] std::uint64_t place() const noexcept { return place_; }
  /// The next row is the one that begins there.
  void go_to(std::uint64_t place);

  /// Value of the wanted column `i`, by its place in `columns`; NaN where the cell is empty or no number.
  [[nodiscard]] double number(std::size_t i) const;
  [[nodiscard]] std::string_view cell(std::size_t i) const { return cells_[i]; }

 private:
  std::ifstream stream_;
  std::string row_;
  std::uint64_t place_ = 0;
  std::uint64_t next_place_ = 0;
  std::vector<std::ptrdiff_t> wanted_;  ///< for each column of the file: its place in `columns`, or -1
  std::vector<std::string_view> cells_;
};

}  // namespace imuscope::tables
