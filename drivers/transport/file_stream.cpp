#include "drivers/transport/file_stream.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <string>
#include <string_view>

namespace imuscope {
namespace fs = std::filesystem;
namespace {

constexpr std::uint64_t kBlock = 65536;
/// Longest read that a list of arrivals may name; a live read is a few kilobytes.
constexpr std::uint64_t kReadMax = 16U << 20U;

/// Three whole numbers with commas between them.
bool parse(std::string_view line, std::array<std::int64_t, 3>& out) {
  const char* at = line.data();
  const char* end = at + line.size();
  for (std::size_t i = 0; i < out.size(); ++i) {
    if (i > 0 && (at == end || *at++ != ',')) return false;
    const auto [next, error] = std::from_chars(at, end, out[i]);
    if (error != std::errc{}) return false;
    at = next;
  }
  return at == end;
}

}  // namespace

Result<FileStream> FileStream::open(const fs::path& file) {
  FileStream stream;
  stream.file_ = file;
  stream.bytes_.open(file, std::ios::binary);
  std::error_code error;
  stream.size_ = fs::file_size(file, error);
  if (!stream.bytes_ || error) {
    return work_error(fmt::format("{} cannot be read: {}", file.string(),
                                  error ? error.message() : std::string(std::strerror(errno))),
                      "check the name and your permissions");
  }
  stream.arrivals_file_ = fs::path(file).replace_extension(".arrivals.csv");
  stream.arrivals_.open(stream.arrivals_file_);
  stream.has_arrivals_ = stream.arrivals_.is_open();
  return stream;
}

Result<std::optional<FileStream::Read>> FileStream::next() {
  if (position_ >= size_) return std::nullopt;
  Listed listed{std::min(kBlock, size_ - position_), last_arrival_};
  if (has_arrivals_) {
    auto found = next_listed();
    if (!found) return tl::unexpected<Error>(std::move(found.error()));
    if (*found) listed = **found;
  }
  buffer_.resize(listed.n_bytes);
  bytes_.read(reinterpret_cast<char*>(buffer_.data()), static_cast<std::streamsize>(buffer_.size()));
  if (!bytes_) return work_error(fmt::format("{} cannot be read at byte {}", file_.string(), position_));
  position_ += listed.n_bytes;
  last_arrival_ = listed.arrival;
  return Read{buffer_, listed.arrival};
}

Result<std::optional<FileStream::Listed>> FileStream::next_listed() {
  std::string line;
  while (std::getline(arrivals_, line)) {
    ++line_;
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line.empty() || line[0] == '#' || (line_ == 1 && line[0] == 'b')) continue;
    const auto refuse = [&](std::string_view why) {
      return work_error(fmt::format("{}:{}: {}", arrivals_file_.string(), line_, why),
                        "lines are byte_offset,n_bytes,arrival_ns, one for each read, without holes");
    };
    std::array<std::int64_t, 3> numbers{};
    if (!parse(line, numbers)) {
      if (arrivals_.eof()) return std::nullopt;  // the recorder was killed within this line
      return refuse(fmt::format("'{}' is not three whole numbers", line));
    }
    const auto [offset, n_bytes, arrival_ns] = numbers;
    if (n_bytes == 0) continue;
    if (offset != static_cast<std::int64_t>(position_)) {
      return refuse(fmt::format("the read begins at byte {}, the one before ended at {}", offset, position_));
    }
    if (n_bytes < 0 || static_cast<std::uint64_t>(n_bytes) > kReadMax) {
      return refuse(fmt::format("a read of {} bytes", n_bytes));
    }
    if (host_time_from_ns(arrival_ns) < last_arrival_) {
      if (arrivals_.eof()) return std::nullopt;
      return refuse("the arrival is before the one before");
    }
    const auto there = std::min(static_cast<std::uint64_t>(n_bytes), size_ - position_);
    return Listed{there, host_time_from_ns(arrival_ns)};
  }
  return std::nullopt;
}

}  // namespace imuscope
