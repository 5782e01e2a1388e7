#include "logs/flight_log/dataflash_reader.h"

#include <fmt/format.h>
#include <algorithm>

namespace imuscope::flight_log {
namespace {

using mcap::Bytes;
using mcap::text_of;

constexpr std::size_t kRecordHead = 3;
/// Kind, length, name, characters of the format, names of the fields.
constexpr std::size_t kFormatSize = kRecordHead + 1 + 1 + 4 + 16 + 64;
constexpr double kHundredth = 1e-2;
constexpr double kDegPerLat = 1e-7;

/// Text up to its first zero.
std::string_view until_zero(Bytes bytes) {
  const auto text = text_of(bytes);
  return text.substr(0, text.find('\0'));
}

/// Adds a field as its character says. False for a character of no known kind.
bool add_field(char character, std::string name, Layout& layout) {
  switch (character) {
    case 'a':
      layout.add(std::move(name), NumberKind::kI16, kSamplesOfBatch);
      return true;
    case 'b':
      layout.add(std::move(name), NumberKind::kI8);
      return true;
    case 'B':
    case 'M':
      layout.add(std::move(name), NumberKind::kU8);
      return true;
    case 'h':
      layout.add(std::move(name), NumberKind::kI16);
      return true;
    case 'H':
      layout.add(std::move(name), NumberKind::kU16);
      return true;
    case 'i':
      layout.add(std::move(name), NumberKind::kI32);
      return true;
    case 'I':
      layout.add(std::move(name), NumberKind::kU32);
      return true;
    case 'q':
      layout.add(std::move(name), NumberKind::kI64);
      return true;
    case 'Q':
      layout.add(std::move(name), NumberKind::kU64);
      return true;
    case 'f':
      layout.add(std::move(name), NumberKind::kF32);
      return true;
    case 'd':
      layout.add(std::move(name), NumberKind::kF64);
      return true;
    case 'c':
      layout.add(std::move(name), NumberKind::kI16, 1, kHundredth);
      return true;
    case 'C':
      layout.add(std::move(name), NumberKind::kU16, 1, kHundredth);
      return true;
    case 'e':
      layout.add(std::move(name), NumberKind::kI32, 1, kHundredth);
      return true;
    case 'E':
      layout.add(std::move(name), NumberKind::kU32, 1, kHundredth);
      return true;
    case 'L':
      layout.add(std::move(name), NumberKind::kI32, 1, kDegPerLat);
      return true;
    case 'g':  // half precision, of nothing that is taken
      layout.pass(2);
      return true;
    case 'n':
      layout.pass(4);
      return true;
    case 'N':
      layout.pass(16);
      return true;
    case 'Z':
      layout.pass(64);
      return true;
    default:
      return false;
  }
}

bool begins_record(Bytes bytes) {
  return bytes.size() >= kRecordHead && bytes[0] == kDataflashMark[0] && bytes[1] == kDataflashMark[1];
}

}  // namespace

Result<DataflashReader> DataflashReader::open(const std::filesystem::path& file) {
  auto window = Window::open(file);
  if (!window) return tl::unexpected<Error>(window.error());
  const Bytes head = window->peek(kRecordHead);
  if (!begins_record(head) || head[2] != kDataflashFormat)
    return work_error(fmt::format("{}: is no DataFlash log of ArduPilot", file.string()),
                      "check how it was made; nothing converts a text .log back");
  return DataflashReader(std::move(*window), file.string());
}

DataflashReader::DataflashReader(Window window, std::string name)
    : window_(std::move(window)), name_(std::move(name)) {
  kinds_[kDataflashFormat].size = kFormatSize;
}

bool DataflashReader::read_record() {
  const Bytes head = window_.peek(kRecordHead);
  if (head.empty()) return false;
  const std::uint64_t left = window_.size() - window_.position();
  if (!begins_record(head) || kinds_[head[2]].size == 0) {
    if (head.size() < kRecordHead && head[0] == kDataflashMark[0]) {
      cut_off_ = true;
      window_.skip(left);
      return false;
    }
    // To the next mark.
    const Bytes piece = window_.peek(64 * 1024).subspan(1);
    const auto found = std::find(piece.begin(), piece.end(), kDataflashMark[0]);
    const auto passed = 1 + static_cast<std::uint64_t>(found - piece.begin());
    bytes_passed_ += passed;
    window_.skip(passed);
    return true;
  }
  Kind& kind = kinds_[head[2]];
  if (kind.size > left) {
    cut_off_ = true;
    window_.skip(left);
    return false;
  }
  const bool is_format = head[2] == kDataflashFormat;
  const Bytes content = window_.peek(kind.size);
  if (content.size() < kind.size) return false;  // the file shrank
  window_.skip(kind.size);
  if (is_format) take_format(content.subspan(kRecordHead));
  if (!is_format && !kind.name.empty() &&
      !messages_.take(kind.name, Fields(kind.layout, content.subspan(kRecordHead)), queue_))
    ++damaged_;
  return true;
}

void DataflashReader::take_format(Bytes content) {
  const std::uint8_t id = content[0];
  const std::size_t size = content[1];
  const std::string_view name = until_zero(content.subspan(2, 4));
  const std::string_view characters = until_zero(content.subspan(6, 16));
  std::string_view labels = until_zero(content.subspan(22, 64));
  if (id == kDataflashFormat || size < kRecordHead) return;
  Kind kind;
  kind.size = size;
  if (ArdupilotMessages::is_taken(name)) {
    bool is_known = true;
    for (const char character : characters) {
      const auto comma = labels.find(',');
      is_known = is_known && add_field(character, std::string(labels.substr(0, comma)), kind.layout);
      labels = comma == std::string_view::npos ? std::string_view{} : labels.substr(comma + 1);
    }
    if (is_known && kind.layout.size() + kRecordHead <= size)
      kind.name = std::string(name);
    else
      ++damaged_;
  }
  kinds_[id] = std::move(kind);
}

std::optional<mcap::Message> DataflashReader::next() {
  for (;;) {
    if (auto message = queue_.take()) return message;
    if (at_end_) return std::nullopt;
    if (read_record()) continue;
    at_end_ = true;
    messages_.finish(queue_);
  }
}

std::vector<std::string> DataflashReader::losses() const {
  std::vector<std::string> losses;
  if (damaged_ > 0) losses.push_back(fmt::format("{}: {} records are damaged", name_, damaged_));
  if (bytes_passed_ > 0)
    losses.push_back(fmt::format("{}: {} bytes are damaged and were passed over", name_, bytes_passed_));
  if (cut_off_) losses.push_back(fmt::format("{}: is cut off; what stands before the cut is used", name_));
  if (messages_.heights_are_of_the_sea())
    losses.push_back(fmt::format(
        "{}: heights are above the sea, not above the ellipsoid: the log has no undulation", name_));
  return losses;
}

}  // namespace imuscope::flight_log
