#pragma once

/// Reads a table of a run folder block by block: bounded memory, however long the run was.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "base/result.h"
#include "results/tables/columns.h"

namespace imuscope::tables {

/// More columns than any table of ours has, by far.
inline constexpr std::size_t kColumnsMax = 256;
/// Longest row, in bytes: every cell of the widest table with all its digits, many times over.
inline constexpr std::size_t kRowMax = 64U << 10U;
/// Different words of a column of text.
inline constexpr std::size_t kWordsMax = 1024;

/// Rows of a table, column by column.
struct Block {
  std::size_t rows = 0;
  /// One entry a column. NaN: an empty cell. Of a column of text the place of its word in
  /// TableReader::words(), -1 for an empty cell.
  std::vector<std::vector<double>> columns;
};

/// Goes through a table once. Thread: one.
class TableReader {
 public:
  /// Columns are known by their names, in whatever order; one that is not known has no unit and is read as a
  /// number. Errors: no regular file (kUsage); no header, a column twice, too many columns (kWork).
  static Result<TableReader> open(const std::filesystem::path& file, const TableKind& kind);

  [[nodiscard]] const std::vector<Column>& columns() const { return columns_; }
  /// Words of a column of text that were met so far, in the order in which they were.
  [[nodiscard]] const std::vector<std::string>& words(std::size_t column) const { return words_[column]; }

  /// At most `rows` more rows; none at the end. A last row that was cut off in the middle (a run that was
  /// killed) is left out. Errors (kWork): text where a number belongs, another number of cells than the
  /// header has, a row longer than kRowMax, more than kWordsMax words; each with line and column.
  [[nodiscard]] Result<Block> next(std::size_t rows);

  /// A row was left out, as the file ends within it.
  [[nodiscard]] bool was_cut_off() const { return cut_off_; }

 private:
  TableReader(std::ifstream stream, std::filesystem::path file)
      : stream_(std::move(stream)), file_(std::move(file)) {}
  [[nodiscard]] Result<void> read_header(const TableKind& kind);
  [[nodiscard]] Result<void> add_row(std::string_view row, Block& block);
  [[nodiscard]] Result<double> value_of(std::string_view cell, std::size_t column);
  [[nodiscard]] Result<void> error(const std::string& what) const;

  std::ifstream stream_;
  std::filesystem::path file_;
  std::vector<Column> columns_;
  std::vector<std::vector<std::string>> words_;
  std::string row_;
  std::size_t line_ = 0;
  bool cut_off_ = false;
};

}  // namespace imuscope::tables
