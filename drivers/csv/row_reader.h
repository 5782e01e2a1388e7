#pragma once

/// Lines of a CSV stream to rows of numbers: header, comments, line ends, and the first mistake with its
/// place.
///
/// The first line that is neither blank nor a comment (#) is the header. Its separator is the first of comma,
/// semicolon and tab that it holds. Names may stand in double quotes; blanks around names and numbers do not
/// count. Columns that nobody asked for are not looked at.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.h"
#include "drivers/device/frame_buffer.h"

namespace imuscope::csv {

/// Longest line that is read.
inline constexpr std::size_t kLineMax = 4096;
/// Columns after this one cannot be asked for.
inline constexpr std::size_t kColumnsMax = 256;

/// A column that is asked for.
struct Column {
  std::string name;
  bool required = true;  ///< false: an empty cell is no mistake and reads as NaN
};

/// The first mistake of a stream.
struct RowError {
  enum class Kind : std::uint8_t {
    kNone,
    kMissingColumn,  ///< the header lacks `column`
    kNotANumber,     ///< `text` stands in `column`
    kNoValue,        ///< `column` is empty, or the line ends before it
    kOutOfRange,     ///< `column` holds a number that cannot be (a latitude of 100 deg, an infinity)
    kTimeGoesBack,   ///< `text` is a time before that of the row above
    kLineTooLong,
  };
  Kind kind = Kind::kNone;
  std::uint64_t line = 0;         ///< counted from 1
  std::array<char, 64> column{};  ///< name, cut, zero-terminated
  std::array<char, 48> text{};    ///< what stands there, cut, zero-terminated
};

/// One sentence: what, and in which line and column.
[[nodiscard]] std::string describe(const RowError& error);

/// Core after construction: no allocation, noexcept.
class RowReader {
 public:
  enum class Line : std::uint8_t {
    kNeedMore,  ///< no complete line is pending
    kNothing,   ///< blank, comment or header
    kRow,       ///< values() holds the row
    kBad,       ///< cannot be used; error() tells the first such line
  };

  explicit RowReader(std::vector<Column> columns);

  /// Takes as many bytes as fit; call next_line() until kNeedMore, then again with the rest.
  std::size_t append(std::span<const std::uint8_t> bytes, HostTime arrival) noexcept {
    return buffer_.append(bytes, arrival);
  }

  /// @param at_end  no more bytes will come: what is pending is the last line
  [[nodiscard]] Line next_line(bool at_end) noexcept;

  /// Of the last row, in the order of the columns asked for. NaN: empty and not required.
  [[nodiscard]] std::span<const double> values() const noexcept { return values_; }
  /// Line number of the last line, from 1; how many bytes it had; when its first byte came.
  [[nodiscard]] std::uint64_t line() const noexcept { return line_; }
  [[nodiscard]] std::size_t line_size() const noexcept { return line_size_; }
  [[nodiscard]] HostTime first_byte() const noexcept { return first_byte_; }
  [[nodiscard]] bool has_header() const noexcept { return has_header_; }
  /// The header's names, as they stand there.
  [[nodiscard]] std::string_view header() const noexcept { return {header_.data(), header_size_}; }

  /// Whether the header's column, counted from 0, is one of those asked for.
  [[nodiscard]] bool is_wanted(std::size_t column) const noexcept {
    return has_header_ && column < kColumnsMax && wanted_of_column_[column] != kNotWanted;
  }

  [[nodiscard]] const RowError& error() const noexcept { return error_; }
  /// Keeps a mistake of the last row that only its user can see, unless there was one before.
  void report(RowError::Kind kind, std::size_t column, std::string_view text = {}) noexcept;

 private:
  [[nodiscard]] Line take_line(std::string_view line) noexcept;
  [[nodiscard]] Line take_header(std::string_view line) noexcept;
  [[nodiscard]] Line take_row(std::string_view line) noexcept;
  [[nodiscard]] bool take_cell(std::size_t wanted, std::string_view cell) noexcept;

  static constexpr std::uint16_t kNotWanted = 0xFFFF;

  std::vector<Column> columns_;
  std::vector<double> values_;
  std::array<std::uint16_t, kColumnsMax> wanted_of_column_{};
  FrameBuffer<2 * kLineMax> buffer_;
  std::size_t taken_ = 0;
  bool skipping_long_line_ = false;

  char separator_ = ',';
  bool has_header_ = false;
  std::array<char, kLineMax> header_{};
  std::size_t header_size_ = 0;
  std::uint64_t line_ = 0;
  std::size_t line_size_ = 0;
  HostTime first_byte_{};
  RowError error_;
};

/// Cells of a line, blanks and double quotes around them taken off.
template <typename Visit>
void for_each_cell(std::string_view line, char separator, Visit&& visit) {
  for (std::size_t index = 0;; ++index) {
    const std::size_t end = line.find(separator);
    std::string_view cell = line.substr(0, end);
    while (!cell.empty() && (cell.front() == ' ' || cell.front() == '\t')) cell.remove_prefix(1);
    while (!cell.empty() && (cell.back() == ' ' || cell.back() == '\t')) cell.remove_suffix(1);
    if (cell.size() >= 2 && cell.front() == '"' && cell.back() == '"') cell = cell.substr(1, cell.size() - 2);
    visit(index, cell);
    if (end == std::string_view::npos) return;
    line.remove_prefix(end + 1);
  }
}

/// Separator of a header line.
[[nodiscard]] char separator_of(std::string_view header) noexcept;

}  // namespace imuscope::csv
