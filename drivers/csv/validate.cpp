#include "drivers/csv/validate.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <fstream>

#include "base/nearest_word.h"

namespace imuscope::csv {
namespace {

constexpr std::size_t kReadSize = 64 * 1024;

bool is_number(std::string_view text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc{} && end == text.data() + text.size();
}

/// What to do about a column that the header lacks.
std::string remedy_for_missing_column(const RowReader& reader) {
  std::string all;
  std::string nearest;
  std::size_t least = std::string::npos;
  bool only_numbers = true;
  const std::string_view wanted(reader.error().column.data());
  for_each_cell(reader.header(), separator_of(reader.header()),
                [&](std::size_t column, std::string_view name) {
                  only_numbers = only_numbers && is_number(name);
                  if (!all.empty()) all += ", ";
                  all += name;
                  // A column that another key asks for, and has, is not meant.
                  if (reader.is_wanted(column)) return;
                  const std::size_t distance = edit_distance(wanted, name);
                  if (distance >= least) return;
                  least = distance;
                  nearest = name;
                });
  if (only_numbers) return "the first line holds numbers: put a line with the names of the columns before it";
  const std::string question = nearest.empty() ? "" : "did you mean '" + nearest + "'? ";
  return question + "its columns are: " + all;
}

class NoSink final : public SampleSink {
  void on_sample(const Sample&) noexcept override {}
};

Result<void> validate(const std::filesystem::path& file, RowDecoder& decoder) {
  const std::string name = file.string();
  std::error_code error;
  if (!std::filesystem::exists(file, error)) return usage_error(name + ": no such file");
  if (std::filesystem::is_directory(file, error))
    return usage_error(name + ": is a directory, not a CSV file");
  std::ifstream in(file, std::ios::binary);
  if (!in) return usage_error(name + ": cannot be read (" + std::strerror(errno) + ")");

  NoSink sink;
  std::vector<char> buffer(kReadSize);
  while (in.read(buffer.data(), static_cast<std::streamsize>(buffer.size())), in.gcount() > 0) {
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(buffer.data());
    decoder.push({bytes, static_cast<std::size_t>(in.gcount())}, {}, sink);
    if (decoder.error().kind != RowError::Kind::kNone) break;
  }
  decoder.finish({}, sink);
  const RowError& found = decoder.error();
  if (found.kind == RowError::Kind::kMissingColumn) {
    return usage_error(name + ", " + describe(found), remedy_for_missing_column(decoder.reader()));
  }
  if (found.kind != RowError::Kind::kNone) {
    return work_error(name + ", " + describe(found), "correct that line, or take it out");
  }
  if (!decoder.reader().has_header()) {
    return work_error(name + ": is empty", "a CSV file has a line with the names of its columns, then rows");
  }
  if (decoder.counters().samples == 0)
    return work_error(name + ": has a header but no row", "check how it was written");
  return {};
}

}  // namespace

Result<void> validate_file(const std::filesystem::path& file, const ImuConfig& config) {
  ImuDecoder decoder(config);
  return validate(file, decoder);
}

Result<void> validate_file(const std::filesystem::path& file, const GnssConfig& config) {
  GnssDecoder decoder(config);
  return validate(file, decoder);
}

}  // namespace imuscope::csv
