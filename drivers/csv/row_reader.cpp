#include "drivers/csv/row_reader.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>

namespace imuscope::csv {
namespace {

constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";

template <std::size_t N>
void copy_text(std::array<char, N>& to, std::string_view text) noexcept {
  const std::size_t n = std::min(text.size(), N - 1);
  std::copy_n(text.begin(), n, to.begin());
  to[n] = '\0';
}

std::string quoted(const char* text) { return "'" + std::string(text) + "'"; }

}  // namespace

std::string describe(const RowError& error) {
  const std::string place = "line " + std::to_string(error.line) + ": ";
  const std::string column = "column " + quoted(error.column.data());
  switch (error.kind) {
    case RowError::Kind::kNone:
      return {};
    case RowError::Kind::kMissingColumn:
      return place + "the header has no " + column;
    case RowError::Kind::kNotANumber:
      return place + quoted(error.text.data()) + " in " + column + " is not a number";
    case RowError::Kind::kNoValue:
      return place + column + " is empty";
    case RowError::Kind::kOutOfRange:
      return place + quoted(error.text.data()) + " in " + column + " is out of range";
    case RowError::Kind::kTimeGoesBack:
      return place + "time " + quoted(error.text.data()) + " in " + column +
             " is before that of the row above";
    case RowError::Kind::kLineTooLong:
      return place + "the line is longer than " + std::to_string(kLineMax) + " bytes";
  }
  return {};
}

char separator_of(std::string_view header) noexcept {
  for (const char separator : {',', ';', '\t'}) {
    if (header.find(separator) != std::string_view::npos) return separator;
  }
  return ',';
}

RowReader::RowReader(std::vector<Column> columns)
    : columns_(std::move(columns)), values_(columns_.size(), std::numeric_limits<double>::quiet_NaN()) {}

void RowReader::report(RowError::Kind kind, std::size_t column, std::string_view text) noexcept {
  if (error_.kind != RowError::Kind::kNone) return;
  error_.kind = kind;
  error_.line = line_;
  copy_text(error_.column, columns_[column].name);
  copy_text(error_.text, text);
}

RowReader::Line RowReader::next_line(bool at_end) noexcept {
  buffer_.consume(taken_);
  taken_ = 0;
  const auto pending = buffer_.pending();
  if (pending.empty()) return Line::kNeedMore;
  const void* found = std::memchr(pending.data(), '\n', pending.size());
  const bool too_long = found == nullptr && pending.size() > kLineMax;
  if (found == nullptr && !too_long && !at_end) return Line::kNeedMore;

  std::size_t size = pending.size();
  if (found != nullptr)
    size = static_cast<std::size_t>(static_cast<const std::uint8_t*>(found) - pending.data());
  taken_ = found != nullptr ? size + 1 : size;
  line_size_ = taken_;
  first_byte_ = buffer_.arrival_of(0);
  if (!skipping_long_line_) ++line_;
  if (skipping_long_line_ || too_long || size > kLineMax) {
    const bool first_part = !skipping_long_line_;
    skipping_long_line_ = found == nullptr;
    if (first_part) report(RowError::Kind::kLineTooLong, 0);
    return Line::kBad;
  }
  return take_line({reinterpret_cast<const char*>(pending.data()), size});
}

RowReader::Line RowReader::take_line(std::string_view line) noexcept {
  if (line_ == 1 && line.starts_with(kByteOrderMark)) line.remove_prefix(kByteOrderMark.size());
  if (line.ends_with('\r')) line.remove_suffix(1);
  const std::size_t first = line.find_first_not_of(" \t");
  if (first == std::string_view::npos || line[first] == '#') return Line::kNothing;
  return has_header_ ? take_row(line) : take_header(line);
}

RowReader::Line RowReader::take_header(std::string_view line) noexcept {
  has_header_ = true;
  header_size_ = std::min(line.size(), header_.size());
  std::memcpy(header_.data(), line.data(), header_size_);
  separator_ = separator_of(line);
  wanted_of_column_.fill(kNotWanted);
  std::size_t found = 0;
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    bool here = false;
    for_each_cell(line, separator_, [&](std::size_t column, std::string_view name) {
      if (here || column >= kColumnsMax || name != columns_[i].name) return;
      here = true;
      wanted_of_column_[column] = static_cast<std::uint16_t>(i);
    });
    found += here ? 1 : 0;
    if (!here) report(RowError::Kind::kMissingColumn, i);
  }
  return found == columns_.size() ? Line::kNothing : Line::kBad;
}

RowReader::Line RowReader::take_row(std::string_view line) noexcept {
  if (error_.kind == RowError::Kind::kMissingColumn) return Line::kBad;
  std::fill(values_.begin(), values_.end(), std::numeric_limits<double>::quiet_NaN());
  bool good = true;
  for_each_cell(line, separator_, [&](std::size_t column, std::string_view cell) {
    if (column >= kColumnsMax || wanted_of_column_[column] == kNotWanted) return;
    good = take_cell(wanted_of_column_[column], cell) && good;
  });
  // A line that ends early leaves its last columns without a value.
  for (std::size_t i = 0; good && i < columns_.size(); ++i) {
    if (!columns_[i].required || !std::isnan(values_[i])) continue;
    report(RowError::Kind::kNoValue, i);
    good = false;
  }
  return good ? Line::kRow : Line::kBad;
}

bool RowReader::take_cell(std::size_t wanted, std::string_view cell) noexcept {
  if (cell.empty()) {
    if (columns_[wanted].required) report(RowError::Kind::kNoValue, wanted);
    return !columns_[wanted].required;
  }
  std::string_view number = cell;
  if (number.front() == '+') number.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), value);
  if (error == std::errc::result_out_of_range) {
    report(RowError::Kind::kOutOfRange, wanted, cell);
    return false;
  }
  if (error != std::errc{} || end != number.data() + number.size()) {
    report(RowError::Kind::kNotANumber, wanted, cell);
    return false;
  }
  if (!std::isfinite(value)) {
    // "nan" is how many programs write an empty cell.
    if (std::isnan(value) && !columns_[wanted].required) return true;
    report(RowError::Kind::kOutOfRange, wanted, cell);
    return false;
  }
  values_[wanted] = value;
  return true;
}

}  // namespace imuscope::csv
