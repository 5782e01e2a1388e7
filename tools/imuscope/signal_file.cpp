#include "signal_file.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <numeric>
#include <optional>
#include <sstream>
#include <string_view>
#include <system_error>

#include "base/line_reader.h"
#include "time_column.h"

namespace imuscope::cli {
namespace {

static_assert(std::endian::native == std::endian::little, ".f64 files are read as they lie in memory");

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

/// The first of `wanted` that does not stand in double quotes.
std::size_t find_unquoted(std::string_view line, char wanted) {
  bool quoted = false;
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (line[i] == '"') quoted = !quoted;
    if (line[i] == wanted && !quoted) return i;
  }
  return std::string_view::npos;
}

bool has_quotes(std::string_view line) { return line.find('"') != std::string_view::npos; }

std::string_view without_comment(std::string_view line) {
  return trimmed(line.substr(0, has_quotes(line) ? find_unquoted(line, '#') : line.find('#')));
}

/// ',' or ';' where the line has one, else tab, else blanks.
char separator_of(std::string_view line) {
  for (const char c : {',', ';', '\t'}) {
    if (find_unquoted(line, c) != std::string_view::npos) return c;
  }
  return ' ';
}

/// Where the cell at the front of the line ends. One that begins with a quote may hold separators.
std::size_t end_of_cell(std::string_view line, char separator) {
  const std::size_t start = line.find_first_not_of(' ');
  if (start == std::string_view::npos || line[start] != '"') return line.find(separator);
  const std::size_t end = find_unquoted(line, separator);
  // A quote that nothing closes is a character like others.
  return end == std::string_view::npos && std::count(line.begin(), line.end(), '"') % 2 != 0
             ? line.find(separator)
             : end;
}

/// @param most  cells after these are left out
void split(std::string_view line, char separator, std::vector<std::string_view>& cells,
           std::size_t most = std::numeric_limits<std::size_t>::max()) {
  cells.clear();
  const bool quoted = has_quotes(line);
  while (cells.size() < most) {
    const std::size_t at = quoted ? end_of_cell(line, separator) : line.find(separator);
    const std::string_view cell = trimmed(line.substr(0, at));
    if (separator != ' ' || !cell.empty()) cells.push_back(cell);
    if (at == std::string_view::npos) return;
    line.remove_prefix(at + 1);
  }
}

std::string_view unquoted(std::string_view cell) {
  return cell.size() > 1 && cell.front() == '"' && cell.back() == '"' ? cell.substr(1, cell.size() - 2)
                                                                      : cell;
}

/// How tables say that a value is missing.
bool is_missing(std::string_view cell) {
  constexpr std::array<std::string_view, 8> kMissing{"", "NA", "N/A", "n/a", "na", "null", "None", "-"};
  return std::find(kMissing.begin(), kMissing.end(), cell) != kMissing.end();
}

std::optional<double> to_number(std::string_view cell) {
  if (!cell.empty() && cell.front() == '+') cell.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  if (error != std::errc() || end != cell.data() + cell.size() || cell.empty()) return std::nullopt;
  return value;
}

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t k = 1; k <= b.size(); ++k) {
      const std::size_t substitute = diagonal + (a[i - 1] == b[k - 1] ? 0U : 1U);
      diagonal = row[k];
      row[k] = std::min({row[k] + 1, row[k - 1] + 1, substitute});
    }
  }
  return row.back();
}

std::string nearest(const std::vector<std::string>& names, std::string_view wanted) {
  return *std::min_element(names.begin(), names.end(), [&](const std::string& a, const std::string& b) {
    return edit_distance(a, wanted) < edit_distance(b, wanted);
  });
}

Result<std::size_t> find_column(const std::vector<std::string>& names, bool has_header,
                                const std::string& wanted, const std::string& file) {
  const std::string list = has_header ? fmt::format("its columns are {}", fmt::join(names, ", "))
                                      : fmt::format("it has {} columns without names", names.size());
  if (wanted.empty()) {
    return usage_error(fmt::format("{} has {} columns and none is chosen", file, names.size()),
                       fmt::format("give --column; {}", list));
  }
  const auto at = std::find(names.begin(), names.end(), wanted);
  if (has_header && at != names.end()) return static_cast<std::size_t>(at - names.begin());
  std::size_t number = 0;
  const auto [end, error] = std::from_chars(wanted.data(), wanted.data() + wanted.size(), number);
  if (error == std::errc() && end == wanted.data() + wanted.size()) {
    if (number >= 1 && number <= names.size()) return number - 1;
    return usage_error(fmt::format("{} has no column {}", file, wanted),
                       fmt::format("columns count from 1; {}", list));
  }
  if (!has_header) return usage_error(fmt::format("{} has no column '{}'", file, wanted), list);
  return usage_error(fmt::format("{} has no column '{}'", file, wanted),
                     fmt::format("did you mean '{}'? {}", nearest(names, wanted), list));
}

/// Holes longer than this, alone or together, are not padded sample by sample: the counter is none.
constexpr std::int64_t kHolesMax = 10'000'000;
constexpr std::size_t kLongestLine = std::size_t{1} << 20U;

class CsvReader {
 public:
  CsvReader(std::string file, const SignalChoice& choice, std::vector<std::string> columns)
      : file_(std::move(file)), choice_(choice), wanted_columns_(std::move(columns)) {
    table_.columns.resize(wanted_columns_.size());
  }

  Result<SignalTable> read(std::istream& in) {
    std::string line;
    while (read_line(in, line, kLongestLine)) {
      ++line_number_;
      if (line.size() > kLongestLine) {
        return work_error(fmt::format("{}, line {}: longer than {} bytes", file_, line_number_, kLongestLine),
                          "a CSV file has one row a line");
      }
      const std::string_view content = without_comment(line);
      if (content.empty()) continue;
      if (auto taken = take(content); !taken) return tl::unexpected(taken.error());
    }
    if (table_.columns.front().empty()) return work_error(fmt::format("{} holds no numbers", file_));
    table_.rate_hz = choice_.rate_hz;
    if (!stamps_s_.empty()) {
      if (auto placed = place_by_time(); !placed) return tl::unexpected(placed.error());
    }
    return std::move(table_);
  }

 private:
  Result<void> take(std::string_view line) {
    if (!started_) return start(line);
    split(line, separator_, cells_, last_read_ + 1);
    return add_row();
  }

  Result<void> start(std::string_view line) {
    started_ = true;
    separator_ = separator_of(line);
    split(line, separator_, cells_);
    const bool has_header =
        std::any_of(cells_.begin(), cells_.end(), [](auto cell) { return !parse_stamp(unquoted(cell)); });
    std::vector<std::string> names;
    for (std::size_t i = 0; i < cells_.size(); ++i)
      names.push_back(has_header ? std::string(unquoted(cells_[i])) : std::to_string(i + 1));
    if (auto found = find_columns(names, has_header); !found) return found;
    return has_header ? Result<void>{} : add_row();
  }

  Result<void> find_columns(const std::vector<std::string>& names, bool has_header) {
    for (const std::string& wanted : wanted_columns_) {
      const auto only = wanted.empty() ? only_signal(names, has_header) : std::nullopt;
      const auto index = only ? Result<std::size_t>(*only) : find_column(names, has_header, wanted, file_);
      if (!index) return tl::unexpected(index.error());
      indices_.push_back(*index);
    }
    if (!choice_.where.empty()) {
      const std::size_t equals = choice_.where.find('=');
      if (equals == std::string::npos || equals == 0) {
        return usage_error(fmt::format("--where {} has no COLUMN=VALUE", choice_.where),
                           "write for instance --where regime=static");
      }
      const auto column = find_column(names, has_header, choice_.where.substr(0, equals), file_);
      if (!column) return tl::unexpected(column.error());
      where_index_ = *column;
      wanted_ = choice_.where.substr(equals + 1);
    }
    if (!choice_.counter.empty()) {
      const auto column = find_column(names, has_header, choice_.counter, file_);
      if (!column) return tl::unexpected(column.error());
      counter_index_ = *column;
    }
    if (auto found = find_time(names, has_header); !found) return found;
    last_read_ = *std::max_element(indices_.begin(), indices_.end());
    for (const auto& index : {where_index_, counter_index_, time_index_, week_index_})
      last_read_ = std::max(last_read_, index.value_or(0));
    return {};
  }

  /// The one column that is not for something else: time by its name, or what the choice names.
  [[nodiscard]] std::optional<std::size_t> only_signal(const std::vector<std::string>& names,
                                                       bool has_header) const {
    const auto is_chosen = [&](const std::string& name) {
      const std::size_t comma = choice_.time.find(',');
      return name == choice_.counter || choice_.where.starts_with(name + "=") ||
             name == choice_.time.substr(0, comma) ||
             (comma != std::string::npos && name == choice_.time.substr(comma + 1));
    };
    std::optional<std::size_t> only;
    for (std::size_t i = 0; i < names.size(); ++i) {
      const bool is_time =
          has_header && (is_time_name(names[i]) || is_week_name(names[i]) || is_week_seconds_name(names[i]));
      if ((is_time && names.size() > 1) || is_chosen(names[i])) continue;
      if (only) return std::nullopt;
      only = i;
    }
    return only;
  }

  Result<void> find_time(const std::vector<std::string>& names, bool has_header) {
    if (choice_.time == "none") return {};
    if (choice_.time.empty()) {
      if (has_header) find_time_by_name(names);
      return {};
    }
    const std::size_t comma = choice_.time.find(',');
    const auto last = find_column(
        names, has_header, comma == std::string::npos ? choice_.time : choice_.time.substr(comma + 1), file_);
    if (!last) return tl::unexpected(last.error());
    time_index_ = *last;
    if (comma == std::string::npos) return {};
    const auto week = find_column(names, has_header, choice_.time.substr(0, comma), file_);
    if (!week) return tl::unexpected(week.error());
    week_index_ = *week;
    return {};
  }

  /// What is read as the signal is no time.
  void find_time_by_name(const std::vector<std::string>& names) {
    const auto at = [&](bool (*is)(std::string_view)) -> std::optional<std::size_t> {
      for (std::size_t i = 0; i < names.size(); ++i) {
        if (std::find(indices_.begin(), indices_.end(), i) == indices_.end() && is(names[i])) return i;
      }
      return std::nullopt;
    };
    time_index_ = at(is_time_name);
    const auto week = at(is_week_name);
    const auto seconds = at(is_week_seconds_name);
    if (time_index_ || !week || !seconds) return;
    week_index_ = week;
    time_index_ = seconds;
  }

  Result<void> take_stamp() {
    const auto text = cell(*time_index_);
    if (!text) return tl::unexpected(text.error());
    const auto stamp = parse_stamp(*text);
    if (!stamp) {
      return work_error(fmt::format("{}, line {}, column {}: '{}' is no time", file_, line_number_,
                                    *time_index_ + 1, *text),
                        "times are seconds, ISO 8601 as in 2026-11-23T07:38:36.5Z, or GPS week and seconds");
    }
    double weeks = 0.0;
    if (week_index_) {
      const auto week = number(*week_index_);
      if (!week) return tl::unexpected(week.error());
      weeks = *week;
    }
    constexpr double kWeek_s = 604'800.0;
    stamps_s_.push_back(weeks * kWeek_s + *stamp);
    return {};
  }

  /// Puts the samples in between that the times say are missing.
  Result<void> place_by_time() {
    auto rows = rows_of_stamps(stamps_s_, counts_, choice_.rate_hz);
    if (!rows) {
      Error error = rows.error();
      error.what = fmt::format("{}: {}", file_, error.what);
      return tl::unexpected(error);
    }
    table_.rate_hz = rows->rate_hz;
    std::int64_t missing = 0;
    for (const std::int64_t n : rows->missing_before) missing = std::min(missing + n, kHolesMax + 1);
    if (missing == 0) return {};
    if (missing > kHolesMax) {
      return work_error(fmt::format("{}: the times leave out more than {} samples", file_, kHolesMax),
                        "cut the file where the long gaps are");
    }
    if (table_.mask.empty()) table_.mask.assign(table_.columns.front().size(), 1);
    table_.mask = with_holes(table_.mask, rows->missing_before);
    for (auto& column : table_.columns) column = with_holes(column, rows->missing_before);
    return {};
  }

  /// Zeros where the times say that samples are missing.
  template <typename T>
  static std::vector<T> with_holes(const std::vector<T>& rows,
                                   const std::vector<std::int64_t>& missing_before) {
    std::vector<T> placed;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      placed.insert(placed.end(), static_cast<std::size_t>(missing_before[i]), T{});
      placed.push_back(rows[i]);
    }
    return placed;
  }

  Result<std::string_view> cell(std::size_t index) const {
    if (index < cells_.size()) return unquoted(cells_[index]);
    return work_error(fmt::format("{}, line {}: {} columns, and column {} is wanted", file_, line_number_,
                                  cells_.size(), index + 1));
  }

  Result<double> number(std::size_t index) const {
    const auto text = cell(index);
    if (!text) return tl::unexpected(text.error());
    if (const auto value = to_number(*text)) return *value;
    return work_error(
        fmt::format("{}, line {}, column {}: '{}' is not a number", file_, line_number_, index + 1, *text));
  }

  /// NaN where the table says that it has none.
  Result<double> signal_value(std::size_t index) const {
    // Nearly all cells are plain numbers.
    if (index < cells_.size()) {
      if (const auto value = to_number(cells_[index])) return *value;
    }
    const auto text = cell(index);
    if (text && is_missing(*text)) return std::numeric_limits<double>::quiet_NaN();
    return number(index);
  }

  Result<void> add_row() {
    row_.clear();
    for (const std::size_t index : indices_) {
      const auto value = signal_value(index);
      if (!value) return tl::unexpected(value.error());
      row_.push_back(*value);
    }
    if (counter_index_) {
      if (auto padded = pad_hole(); !padded) return padded;
    }
    if (time_index_) {
      if (auto taken = take_stamp(); !taken) return taken;
    }
    bool valid = true;
    if (where_index_) {
      const auto text = cell(*where_index_);
      if (!text) return tl::unexpected(text.error());
      valid = *text == wanted_;
    }
    for (std::size_t i = 0; i < row_.size(); ++i) table_.columns[i].push_back(row_[i]);
    add_to_mask(valid);
    return {};
  }

  /// Samples that the counter says are missing before this row.
  Result<void> pad_hole() {
    const auto count = number(*counter_index_);
    if (!count) return tl::unexpected(count.error());
    constexpr double kWholeNumbersEnd = 9007199254740992.0;  // 2^53: doubles beyond it do not count by ones
    if (!(std::abs(*count) < kWholeNumbersEnd)) {
      return work_error(fmt::format("{}, line {}: {} is no count", file_, line_number_, *count));
    }
    const auto counter = static_cast<std::int64_t>(std::llround(*count));
    const std::int64_t hole = next_counter_ ? counter - *next_counter_ : 0;
    padded_ += hole;
    if (hole < 0 || padded_ > kHolesMax) {
      return work_error(fmt::format("{}, line {}: the counter goes from {} to {}", file_, line_number_,
                                    *next_counter_ - 1, counter),
                        "it must rise from row to row");
    }
    for (std::int64_t i = 0; i < hole; ++i) {
      for (auto& column : table_.columns) column.push_back(0.0);
      add_to_mask(false);
    }
    next_counter_ = counter + 1;
    counts_.push_back(counter);
    return {};
  }

  void add_to_mask(bool valid) {
    if (where_index_ || counter_index_) table_.mask.push_back(valid ? 1 : 0);
  }

  std::string file_;
  const SignalChoice& choice_;
  std::vector<std::string> wanted_columns_;
  std::vector<std::string_view> cells_;
  SignalTable table_;
  std::vector<std::size_t> indices_;  ///< of the wanted columns
  std::size_t last_read_ = 0;         ///< nothing after this cell is looked at
  std::vector<double> row_;
  std::optional<std::size_t> where_index_;
  std::string wanted_;
  std::optional<std::size_t> counter_index_;
  std::optional<std::int64_t> next_counter_;
  std::int64_t padded_ = 0;
  std::vector<std::int64_t> counts_;  ///< of the rows, with a counter
  std::optional<std::size_t> time_index_;
  std::optional<std::size_t> week_index_;
  std::vector<double> stamps_s_;  ///< of the rows
  std::size_t line_number_ = 0;
  char separator_ = ',';
  bool started_ = false;
};

Result<Signal> read_raw(std::istream& in, std::uintmax_t size, const std::string& file,
                        const SignalChoice& choice) {
  if (!choice.column.empty() || !choice.where.empty() || !choice.counter.empty() || !choice.time.empty()) {
    return usage_error(fmt::format("{} is raw float64 and has no columns", file),
                       "leave out --column, --where, --counter and --time");
  }
  if (size % sizeof(double) != 0) {
    return work_error(fmt::format("{} has {} bytes, which is no whole number of float64 values", file, size));
  }
  Signal signal;
  signal.rate_hz = choice.rate_hz;
  signal.values.reserve(size / sizeof(double) + 1);  // sums of them take one more place
  signal.values.resize(size / sizeof(double));
  if (!in.read(reinterpret_cast<char*>(signal.values.data()), static_cast<std::streamsize>(size))) {
    return work_error(fmt::format("{} could not be read to its end", file));
  }
  return signal;
}

}  // namespace

std::vector<std::string> cells_of(std::string_view line) {
  const std::string_view content = without_comment(line);
  std::vector<std::string> out;
  if (content.empty()) return out;
  std::vector<std::string_view> cells;
  split(content, separator_of(content), cells);
  for (const auto cell : cells) out.emplace_back(unquoted(cell));
  return out;
}

namespace {

/// Opens a file that holds something.
Result<std::ifstream> open_signal(const std::filesystem::path& file) {
  const std::string name = file.string();
  std::error_code error;
  const auto status = std::filesystem::status(file, error);
  if (!std::filesystem::exists(status)) return work_error(fmt::format("{} does not exist", name));
  if (std::filesystem::is_directory(status)) {
    return work_error(fmt::format("{} is a folder", name), "give a CSV or .f64 file");
  }
  std::ifstream in(file, std::ios::binary);
  if (!in) return work_error(fmt::format("{} cannot be opened: {}", name, std::strerror(errno)));
  if (in.peek() == std::ifstream::traits_type::eof()) return work_error(fmt::format("{} is empty", name));
  return in;
}

}  // namespace

Result<SignalTable> read_signals(const std::filesystem::path& file, const SignalChoice& choice,
                                 const std::vector<std::string>& columns) {
  auto in = open_signal(file);
  if (!in) return tl::unexpected(in.error());
  return CsvReader(file.string(), choice, columns).read(*in);
}

Result<Signal> read_signal(const std::filesystem::path& file, const SignalChoice& choice) {
  auto in = open_signal(file);
  if (!in) return tl::unexpected(in.error());
  std::error_code error;
  if (file.extension() == ".f64")
    return read_raw(*in, std::filesystem::file_size(file, error), file.string(), choice);
  auto table = CsvReader(file.string(), choice, {choice.column}).read(*in);
  if (!table) return tl::unexpected(table.error());
  return Signal{std::move(table->columns.front()), std::move(table->mask), table->rate_hz};
}

}  // namespace imuscope::cli
