#include "results/tables/table_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <limits>
#include <utility>

#include "base/line_reader.h"
#include "base/text.h"

namespace imuscope::tables {
namespace {

/// Goes through the cells of a row.
template <typename Take>
void for_each_cell(std::string_view row, Take take) {
  for (;;) {
    const std::size_t comma = row.find(',');
    take(row.substr(0, comma));
    if (comma == std::string_view::npos) return;
    row.remove_prefix(comma + 1);
  }
}

Column column_named(std::string_view name, const TableKind& kind) {
  const auto at = std::find_if(kind.columns.begin(), kind.columns.end(),
                               [&](const Column& column) { return column.name == name; });
  return at != kind.columns.end() ? *at : Column{one_line(name), {}, {}, CellKind::kNumber};
}

void without_carriage_return(std::string& row) {
  if (row.ends_with('\r')) row.pop_back();
}

}  // namespace

Result<TableReader> TableReader::open(const std::filesystem::path& file, const TableKind& kind) {
  std::error_code failed;
  if (!std::filesystem::is_regular_file(file, failed)) {
    return usage_error(fmt::format("{} is no file that can be read", file.string()),
                       "give the folder of a run");
  }
  std::ifstream stream(file, std::ios::binary);
  if (!stream) return usage_error(fmt::format("{} cannot be read", file.string()), "check its permissions");
  TableReader reader(std::move(stream), file);
  if (auto header = reader.read_header(kind); !header) return tl::unexpected<Error>(header.error());
  return reader;
}

Result<void> TableReader::error(const std::string& what) const {
  return work_error(fmt::format("{}, line {}: {}", file_.string(), line_, what),
                    "take the file as the run wrote it");
}

Result<void> TableReader::read_header(const TableKind& kind) {
  line_ = 1;
  if (!read_line(stream_, row_, kRowMax) || row_.size() > kRowMax || row_.empty())
    return error("there is no header");
  without_carriage_return(row_);
  std::string wrong;
  for_each_cell(row_, [&](std::string_view name) {
    if (!wrong.empty()) return;
    if (columns_.size() == kColumnsMax) {
      wrong = fmt::format("there are more than {} columns", kColumnsMax);
      return;
    }
    Column column = column_named(name, kind);
    const bool is_twice = std::any_of(columns_.begin(), columns_.end(),
                                      [&](const Column& other) { return other.name == column.name; });
    if (is_twice || column.name.empty())
      wrong = column.name.empty() ? "a column has no name"
                                  : fmt::format("the column {} is there twice", column.name);
    columns_.push_back(std::move(column));
  });
  if (!wrong.empty()) return error(wrong);
  words_.resize(columns_.size());
  return {};
}

Result<double> TableReader::value_of(std::string_view cell, std::size_t column) {
  if (columns_[column].kind == CellKind::kText) {
    constexpr double kNoWord = -1.0;
    if (cell.empty()) return kNoWord;
    auto& words = words_[column];
    const std::string word = one_line(cell);
    const auto at = std::find(words.begin(), words.end(), word);
    if (at != words.end()) return static_cast<double>(at - words.begin());
    if (words.size() == kWordsMax) {
      return tl::unexpected<Error>(
          error(fmt::format("{} has more than {} different words", columns_[column].name, kWordsMax))
              .error());
    }
    words.push_back(word);
    return static_cast<double>(words.size() - 1);
  }
  double value = std::numeric_limits<double>::quiet_NaN();
  if (cell.empty()) return value;
  const auto [end, failed] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  if (failed != std::errc() || end != cell.data() + cell.size()) {
    constexpr std::size_t kShown = 40;
    return tl::unexpected<Error>(
        error(fmt::format("{} is \"{}\", which is no number", columns_[column].name, one_line(cell, kShown)))
            .error());
  }
  return value;
}

Result<void> TableReader::add_row(std::string_view row, Block& block) {
  std::size_t column = 0;
  Result<void> added;
  for_each_cell(row, [&](std::string_view cell) {
    if (added && column < columns_.size()) {
      if (const auto value = value_of(cell, column)) {
        block.columns[column].push_back(*value);
      } else {
        added = tl::unexpected<Error>(value.error());
      }
    }
    ++column;
  });
  if (added && column != columns_.size())
    return error(fmt::format("there are {} cells, and the header has {}", column, columns_.size()));
  if (added) ++block.rows;
  return added;
}

Result<Block> TableReader::next(std::size_t rows) {
  Block block;
  block.columns.resize(columns_.size());
  while (block.rows < rows && read_line(stream_, row_, kRowMax)) {
    ++line_;
    if (stream_.eof()) {  // no line end came
      cut_off_ = true;
      break;
    }
    if (row_.size() > kRowMax)
      return tl::unexpected<Error>(error(fmt::format("it has more than {} bytes", kRowMax)).error());
    without_carriage_return(row_);
    if (auto added = add_row(row_, block); !added) return tl::unexpected<Error>(added.error());
  }
  return block;
}

}  // namespace imuscope::tables
