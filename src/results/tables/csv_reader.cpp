#include "results/tables/csv_reader.h"

#include <algorithm>
#include <charconv>
#include <limits>

#include "base/line_reader.h"

namespace imuscope::tables {
namespace {

/// No row of a run is as long: longer ones are damage.
constexpr std::size_t kLongestRow = 65536;

/// Takes the text before the next comma off the front of `rest`.
std::string_view take_cell(std::string_view& rest) {
  const std::size_t comma = rest.find(',');
  const std::string_view cell = rest.substr(0, comma);
  rest = comma == std::string_view::npos ? std::string_view{} : rest.substr(comma + 1);
  return cell;
}

void drop_carriage_return(std::string& line) {
  if (!line.empty() && line.back() == '\r') line.pop_back();
}

}  // namespace

Result<CsvReader> CsvReader::open(const std::filesystem::path& file,
                                  const std::vector<std::string>& columns) {
  CsvReader reader;
  reader.stream_.open(file);
  std::string header;
  if (!reader.stream_ || !read_line(reader.stream_, header, kLongestRow)) {
    return work_error(file.string() + " cannot be read or is empty",
                      "make the run again, or remove the file");
  }
  reader.next_place_ = header.size() + 1;
  drop_carriage_return(header);
  reader.cells_.resize(columns.size());
  std::string_view rest = header;
  std::size_t n_found = 0;
  do {
    const auto place = std::find(columns.begin(), columns.end(), take_cell(rest));
    reader.wanted_.push_back(place == columns.end() ? -1 : place - columns.begin());
    if (place != columns.end()) ++n_found;
  } while (!rest.empty());
  if (n_found < columns.size()) {
    for (std::size_t i = 0; i < columns.size(); ++i) {
      const auto place = static_cast<std::ptrdiff_t>(i);
      if (std::find(reader.wanted_.begin(), reader.wanted_.end(), place) == reader.wanted_.end()) {
        return work_error(file.string() + " has no column '" + columns[i] + "'",
                          "make the run again with this version, or remove the file");
      }
    }
  }
  return reader;
}

void CsvReader::go_to(std::uint64_t place) {
  stream_.clear();
  stream_.seekg(static_cast<std::streamoff>(place));
  place_ = next_place_ = place;
}

bool CsvReader::next() {
  place_ = next_place_;
  if (!read_line(stream_, row_, kLongestRow) || row_.size() > kLongestRow) return false;
  next_place_ += row_.size() + 1;
  drop_carriage_return(row_);
  std::string_view rest = row_;
  for (std::size_t i = 0; i < wanted_.size(); ++i) {
    if (i > 0 && rest.data() == nullptr) return false;
    const std::string_view cell = take_cell(rest);
    if (wanted_[i] >= 0) cells_[static_cast<std::size_t>(wanted_[i])] = cell;
  }
  return true;
}

double CsvReader::number(std::size_t i) const {
  double value = std::numeric_limits<double>::quiet_NaN();
  const std::string_view cell = cells_[i];
  const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  if (error != std::errc{} || end != cell.data() + cell.size()) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  return value;
}

}  // namespace imuscope::tables
