#include "signal_file.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <fstream>
#include <numeric>
#include <optional>
#include <sstream>
#include <string_view>
#include <system_error>

namespace imuscope::cli {
namespace {

static_assert(std::endian::native == std::endian::little, ".f64 files are read as they lie in memory");

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

/// ',' or ';' where the line has one, else tab, else blanks.
char separator_of(std::string_view line) {
  for (const char c : {',', ';', '\t'}) {
    if (line.find(c) != std::string_view::npos) return c;
  }
  return ' ';
}

void split(std::string_view line, char separator, std::vector<std::string_view>& cells) {
  cells.clear();
  while (true) {
    const std::size_t at = line.find(separator);
    const std::string_view cell = trimmed(line.substr(0, at));
    if (separator != ' ' || !cell.empty()) cells.push_back(cell);
    if (at == std::string_view::npos) return;
    line.remove_prefix(at + 1);
  }
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
    if (names.size() == 1) return 0;
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

class CsvReader {
 public:
  CsvReader(std::string file, const std::string& column) : file_(std::move(file)), column_(column) {}

  Result<std::vector<double>> read(std::istream& in) {
    std::string line;
    while (std::getline(in, line)) {
      ++line_number_;
      const std::string_view content = trimmed(std::string_view(line).substr(0, line.find('#')));
      if (content.empty()) continue;
      if (auto taken = take(content); !taken) return tl::unexpected(taken.error());
    }
    if (values_.empty()) return work_error(fmt::format("{} holds no numbers", file_));
    return std::move(values_);
  }

 private:
  Result<void> take(std::string_view line) {
    if (!started_) return start(line);
    split(line, separator_, cells_);
    return add_value();
  }

  Result<void> start(std::string_view line) {
    started_ = true;
    separator_ = separator_of(line);
    split(line, separator_, cells_);
    const bool has_header =
        std::any_of(cells_.begin(), cells_.end(), [](auto cell) { return !to_number(cell); });
    std::vector<std::string> names;
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      std::string_view name = cells_[i];
      if (name.size() > 1 && name.front() == '"' && name.back() == '"')
        name = name.substr(1, name.size() - 2);
      names.push_back(has_header ? std::string(name) : std::to_string(i + 1));
    }
    const auto index = find_column(names, has_header, column_, file_);
    if (!index) return tl::unexpected(index.error());
    index_ = *index;
    return has_header ? Result<void>{} : add_value();
  }

  Result<void> add_value() {
    if (index_ >= cells_.size()) {
      return work_error(fmt::format("{}, line {}: {} columns, and column {} is wanted", file_, line_number_,
                                    cells_.size(), index_ + 1));
    }
    const auto value = to_number(cells_[index_]);
    if (!value) {
      return work_error(fmt::format("{}, line {}, column {}: '{}' is not a number", file_, line_number_,
                                    index_ + 1, cells_[index_]));
    }
    values_.push_back(*value);
    return {};
  }

  std::string file_;
  const std::string& column_;
  std::vector<std::string_view> cells_;
  std::vector<double> values_;
  std::size_t index_ = 0;
  std::size_t line_number_ = 0;
  char separator_ = ',';
  bool started_ = false;
};

Result<std::vector<double>> read_raw(std::istream& in, std::uintmax_t size, const std::string& file,
                                     const std::string& column) {
  if (!column.empty())
    return usage_error(fmt::format("{} is raw float64 and has no columns", file), "leave out --column");
  if (size % sizeof(double) != 0) {
    return work_error(fmt::format("{} has {} bytes, which is no whole number of float64 values", file, size));
  }
  std::vector<double> values(size / sizeof(double));
  if (!in.read(reinterpret_cast<char*>(values.data()), static_cast<std::streamsize>(size))) {
    return work_error(fmt::format("{} could not be read to its end", file));
  }
  return values;
}

}  // namespace

Result<std::vector<double>> read_signal(const std::filesystem::path& file, const std::string& column) {
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
  if (file.extension() == ".f64") return read_raw(in, std::filesystem::file_size(file, error), name, column);
  return CsvReader(name, column).read(in);
}

}  // namespace imuscope::cli
