#include "capture/raw_dump.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>
#include <fstream>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "base/missing_file.h"
#include "capture/stamp_range.h"

namespace imuscope {
namespace {

constexpr std::string_view kHeader = "byte_offset,n_bytes,arrival_ns";
constexpr std::size_t kBlockBytes = 4096;  // of a dump without arrivals
constexpr std::size_t kColumns = 3;
constexpr std::size_t kLongestLine = 256;
/// No read of a device brings as much at once; a dump that is claimed to be one is given in pieces of this.
constexpr std::uint64_t kLongestPiece = std::uint64_t{1} << 20U;

/// The next line, without its end; of one longer than kLongestLine the first kLongestLine + 1 bytes, and the
/// rest is passed over.
/// @param has_end  false for a last line without its end
/// @return false where nothing is left
bool next_line(FileWindow& file, std::string& line, bool& has_end) {
  line.clear();
  has_end = false;
  for (auto there = file.look(kLongestLine); !there.empty(); there = file.look(kLongestLine)) {
    const auto* const end = static_cast<const std::uint8_t*>(std::memchr(there.data(), '\n', there.size()));
    has_end = end != nullptr;
    const std::size_t length = has_end ? static_cast<std::size_t>(end - there.data()) : there.size();
    line.append(reinterpret_cast<const char*>(there.data()),
                std::min(length, kLongestLine + 1 - line.size()));
    file.pass(has_end ? length + 1 : length);
    if (has_end) break;
  }
  return has_end || !line.empty();
}

std::string_view without_line_end(std::string_view line) {
  while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) line.remove_suffix(1);
  return line;
}

/// Three whole numbers separated by commas, nothing else.
std::optional<std::array<std::int64_t, kColumns>> parse_line(std::string_view line) {
  std::array<std::int64_t, kColumns> numbers{};
  const char* at = line.data();
  const char* const end = at + line.size();
  for (std::size_t column = 0; column < kColumns; ++column) {
    if (column > 0) {
      if (at == end || *at != ',') return std::nullopt;
      ++at;
    }
    const auto [after, error] = std::from_chars(at, end, numbers[column]);
    if (error != std::errc()) return std::nullopt;
    at = after;
  }
  if (at != end) return std::nullopt;
  return numbers;
}

}  // namespace

std::filesystem::path RawDump::arrivals_path(const std::filesystem::path& dump) {
  std::filesystem::path path = dump;
  path.replace_extension(".arrivals.csv");
  return path;
}

Result<RawDump> RawDump::open(const std::filesystem::path& path, Arrivals arrivals) {
  const std::string name = path.string();
  std::error_code error;
  const auto status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status))
    return tl::unexpected<Error>(explain_missing(name, error, "check the path"));
  if (std::filesystem::is_directory(status)) {
    return usage_error(name + " is a folder, not a raw dump", "name the file in it");
  }
  std::ifstream file(path, std::ios::binary);
  if (!file) return usage_error(name + " cannot be read", "check its permissions");
  const auto size = std::filesystem::is_regular_file(status) ? std::filesystem::file_size(path, error) : 0;
  if (size == 0) return work_error(name + " is empty: it holds no device bytes", "check how it was recorded");

  std::optional<FileWindow> stamps;
  if (std::filesystem::exists(arrivals_path(path), error)) {
    if (arrivals == Arrivals::kToCheck) {
      if (auto checked = check_arrivals(arrivals_path(path), size); !checked)
        return tl::unexpected(checked.error());
    }
    stamps.emplace(std::ifstream(arrivals_path(path), std::ios::binary));
  }
  return RawDump(FileWindow(std::move(file)), std::move(stamps));
}

Result<void> RawDump::check_arrivals(const std::filesystem::path& path, std::uint64_t dump_bytes) {
  FileWindow file(std::ifstream(path, std::ios::binary));
  std::size_t line_number = 0;
  const auto wrong = [&](const std::string& what) {
    return usage_error(path.string() + ":" + std::to_string(line_number) + ": " + what,
                       "correct the file, or remove it to take the times from the bytes");
  };
  HostTime newest = HostTime::min();
  std::uint64_t offset = 0;
  std::string text;
  bool has_end = false;
  while (next_line(file, text, has_end)) {
    // A last line without its end is what a kill leaves of it.
    const bool is_unfinished = !has_end && offset > 0;
    line_number += 1;
    const std::string_view line = without_line_end(text);
    if (line_number == 1) {
      if (line != kHeader)
        return wrong("the header is '" + std::string(line) + "', not '" + std::string(kHeader) + "'");
      continue;
    }
    if (line.empty() || line.front() == '#') continue;
    const auto numbers = parse_line(line);
    if (!numbers && is_unfinished) break;
    if (!numbers) return wrong("'" + std::string(line) + "' is not three whole numbers");
    const auto [byte_offset, n_bytes, arrival_ns] = *numbers;
    if (n_bytes <= 0) return wrong("a read of " + std::to_string(n_bytes) + " bytes");
    if (byte_offset < 0 || static_cast<std::uint64_t>(byte_offset) != offset) {
      return wrong("byte_offset is " + std::to_string(byte_offset) + ", but the read before ends at " +
                   std::to_string(offset));
    }
    if (!is_stamp_ns(arrival_ns)) return wrong("an arrival_ns that no clock has reached");
    const HostTime arrival = host_time_from_ns(arrival_ns);
    if (arrival < newest) return wrong("arrival_ns goes back");
    newest = arrival;
    offset += static_cast<std::uint64_t>(n_bytes);
    if (offset >= dump_bytes) break;
  }
  if (line_number == 0) {
    line_number = 1;
    return wrong("the file is empty");
  }
  if (offset < dump_bytes) {
    return wrong("the reads end at byte " + std::to_string(offset) + " of " + std::to_string(dump_bytes));
  }
  return {};
}

/// Goes on to the next line that tells of a read; what stands there was checked when the dump was opened.
bool RawDump::next_arrival() {
  bool has_end = false;
  while (next_line(*arrivals_, line_, has_end)) {
    const auto numbers = parse_line(without_line_end(line_));
    if (!numbers) continue;
    current_ = {static_cast<std::uint64_t>((*numbers)[1]), host_time_from_ns((*numbers)[2])};
    return true;
  }
  return false;
}

std::optional<RawDump::Read> RawDump::next() {
  bytes_.pass(std::exchange(given_, 0));
  Read read;
  std::uint64_t wanted = kBlockBytes;
  if (has_arrivals()) {
    if (current_.n_bytes == 0 && !next_arrival()) return std::nullopt;
    wanted = std::min(current_.n_bytes, kLongestPiece);
    current_.n_bytes -= wanted;
    read.arrival = current_.arrival;
  }
  const auto there = bytes_.look(static_cast<std::size_t>(wanted));
  if (there.empty()) return std::nullopt;
  given_ = std::min(there.size(), static_cast<std::size_t>(wanted));
  read.bytes = there.first(given_);
  return read;
}

}  // namespace imuscope
