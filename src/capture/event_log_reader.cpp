#include "capture/event_log_reader.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <string_view>
#include <system_error>
#include <utility>

#include "base/bytes.h"
#include "base/missing_file.h"

namespace imuscope {
namespace {

constexpr std::size_t kReadBytes = std::size_t{256} << 10U;
constexpr std::size_t kSniffBytes = 64;
constexpr std::size_t kMovesPerByte = 4;

// Offsets of the fields of a record header.
constexpr std::size_t kNumberAt = 4;
constexpr std::size_t kUtimeAt = 12;
constexpr std::size_t kChannelLengthAt = 20;
constexpr std::size_t kDataLengthAt = 24;

template <typename Integer>
Integer number_at(const std::uint8_t* at) noexcept {
  return read_be<Integer>({at, sizeof(Integer)});
}

struct Lengths {
  std::size_t channel;
  std::size_t data;
  [[nodiscard]] bool plausible() const {
    return channel > 0 && channel < kMaxEventChannelBytes && data <= kMaxEventDataBytes;
  }
  [[nodiscard]] std::size_t record() const { return kEventLogHeaderBytes + channel + data; }
};

Lengths lengths_of(const std::uint8_t* header) {
  return {number_at<std::uint32_t>(header + kChannelLengthAt),
          number_at<std::uint32_t>(header + kDataLengthAt)};
}

/// As it stands in a file.
constexpr std::array<std::uint8_t, sizeof kEventLogSync> kSyncWord{
    kEventLogSync >> 24U & 0xFFU, kEventLogSync >> 16U & 0xFFU, kEventLogSync >> 8U & 0xFFU,
    kEventLogSync & 0xFFU};

/// A whole record, by its header.
LogEventView view_of(const std::uint8_t* record) noexcept {
  const Lengths lengths = lengths_of(record);
  LogEventView event;
  event.number = number_at<std::int64_t>(record + kNumberAt);
  event.utime = number_at<std::int64_t>(record + kUtimeAt);
  const std::uint8_t* channel = record + kEventLogHeaderBytes;
  event.channel = {reinterpret_cast<const char*>(channel), lengths.channel};
  event.data = {channel + lengths.channel, lengths.data};
  return event;
}

bool is_sync(const std::uint8_t* bytes) { return number_at<std::uint32_t>(bytes) == kEventLogSync; }

bool is_text(const std::vector<std::uint8_t>& bytes) {
  return std::all_of(bytes.begin(), bytes.end(),
                     [](std::uint8_t byte) { return std::isprint(byte) != 0 || std::isspace(byte) != 0; });
}

std::string in_hex(const std::vector<std::uint8_t>& bytes) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  constexpr std::size_t kShown = 8;
  std::string text;
  for (std::size_t i = 0; i < std::min(bytes.size(), kShown); ++i) {
    if (i > 0) text += ' ';
    text += kDigits[bytes[i] >> 4U];
    text += kDigits[bytes[i] & 0xfU];
  }
  return text;
}

}  // namespace

std::string describe_bytes(const std::vector<std::uint8_t>& first_bytes) {
  struct Magic {
    std::string_view bytes;
    std::string_view name;
  };
  constexpr std::array<Magic, 6> kMagics{{{"\x1f\x8b", "a gzip archive"},
                                          {"PK\x03\x04", "a zip archive"},
                                          {"\xfd"
                                           "7zXZ",
                                           "an xz archive"},
                                          {"\x28\xb5\x2f\xfd", "a zstd archive"},
                                          {"\x7f"
                                           "ELF",
                                           "a program"},
                                          {"#ROSBAG", "a ROS bag"}}};
  const std::string_view view(reinterpret_cast<const char*>(first_bytes.data()), first_bytes.size());
  for (const Magic& magic : kMagics) {
    if (view.starts_with(magic.bytes)) return std::string(magic.name);
  }
  if (is_text(first_bytes)) {
    constexpr std::size_t kShown = 32;
    return "text that begins with '" +
           std::string(view.substr(0, std::min(view.find_first_of("\r\n"), kShown))) + "'";
  }
  return "binary data that begins with the bytes " + in_hex(first_bytes);
}

Result<EventLogReader> EventLogReader::open(const std::filesystem::path& path, Beginning beginning) {
  std::error_code error;
  const auto status = std::filesystem::status(path, error);
  const std::string name = path.string();
  if (!std::filesystem::exists(status))
    return tl::unexpected<Error>(explain_missing(name, error, "check the path"));
  if (std::filesystem::is_directory(status)) {
    return usage_error(name + " is a folder, not a capture", "name the .lcm file in it");
  }
  std::ifstream file(path, std::ios::binary);
  if (!file) return usage_error(name + " cannot be read", "check its permissions");

  EventLogReader reader(std::move(file));
  (void)reader.ensure(kSniffBytes);
  if (reader.available() == 0) {
    return work_error(name + " is empty: nothing was recorded",
                      "check that recording ran and the disk had space");
  }
  constexpr std::size_t kSyncBytes = sizeof kEventLogSync;
  const bool has_sync = reader.available() >= kSyncBytes && is_sync(reader.at(0));
  if (!has_sync && beginning == Beginning::kIsARecord) {
    const std::vector<std::uint8_t> first(reader.at(0), reader.at(std::min(reader.available(), kSniffBytes)));
    return usage_error(
        name + " is not a capture (an LCM event log) but " + describe_bytes(first),
        "give a raw device dump as NAME=" + name + ", with the device's name in the configuration");
  }
  return reader;
}

bool EventLogReader::ensure(std::size_t n) {
  if (available() >= n) return true;
  if (!file_) return false;
  // A long record at its length, not at the next power of two; memory that is never filled costs nothing.
  if (n > available() + kReadBytes) buffer_.reserve(begin_ + n + kReadBytes);
  while (available() < n && file_) read_block();
  return available() >= n;
}

/// By blocks: a record may claim a length that the file does not have.
void EventLogReader::read_block() {
  // What nobody needs any more goes to make room. Moving what is left costs as much as it is long: where a quarter of it
  // was consumed, every byte is moved four times at most.
  const std::uint64_t first = read_ - end_;  // place of the buffer's first byte
  const std::size_t spent = kept_ < place() ? static_cast<std::size_t>(kept_ - first) : begin_;
  if (buffer_.size() - end_ < kReadBytes && kMovesPerByte * spent >= end_ - spent) {
    std::copy(buffer_.begin() + static_cast<std::ptrdiff_t>(spent),
              buffer_.begin() + static_cast<std::ptrdiff_t>(end_), buffer_.begin());
    begin_ -= spent;
    end_ -= spent;
  }
  if (buffer_.size() - end_ < kReadBytes) buffer_.resize(end_ + kReadBytes);
  file_.read(reinterpret_cast<char*>(buffer_.data() + end_), static_cast<std::streamsize>(kReadBytes));
  const auto n = static_cast<std::size_t>(file_.gcount());
  end_ += n;
  read_ += n;
  if (on_read_) on_read_(read_);
}

/// The record that begins `position` bytes after the last one consumed, by its header alone.
EventLogReader::Look EventLogReader::look_at(std::size_t position, std::size_t& length) {
  const bool header_is_here = ensure(position + kEventLogHeaderBytes);
  if (!may_begin_record(position)) return Look::kNoRecord;
  if (!header_is_here) return Look::kCutOff;
  const Lengths lengths = lengths_of(at(position));
  if (!lengths.plausible()) return Look::kNoRecord;
  length = lengths.record();
  return ensure(position + length) ? Look::kRecord : Look::kCutOff;
}

/// Whether the sync word, as far as the file goes, stands at `position`; true at the end of the file.
bool EventLogReader::may_begin_record(std::size_t position) {
  constexpr std::size_t kSyncBytes = sizeof kEventLogSync;
  (void)ensure(position + kSyncBytes);
  const std::size_t here = std::min(available() - position, kSyncBytes);
  return std::equal(at(position), at(position) + here, kSyncWord.begin());
}

/// Where a sync word may begin at the earliest, `position` or later: what lies before it in the buffer is
/// none.
std::size_t EventLogReader::next_sync(std::size_t position) {
  constexpr auto kFirst = static_cast<std::uint8_t>(kEventLogSync >> 24U);
  const std::uint8_t* const end = at(available());
  return static_cast<std::size_t>(std::find(at(std::min(position, available())), end, kFirst) - at(0));
}

/// Where the first record begins after `position` and before `limit` that another record, or the end of the
/// file, follows without a gap.
std::optional<std::size_t> EventLogReader::next_sure_record(std::size_t position, std::size_t limit) {
  std::size_t length = 0;
  for (std::size_t next = position + 1; next < limit && ensure(next + kEventLogHeaderBytes); ++next) {
    next = next_sync(next);
    if (next >= limit || !ensure(next + kEventLogHeaderBytes)) break;
    if (look_at(next, length) == Look::kRecord && may_begin_record(next + length)) return next;
  }
  return std::nullopt;
}

/// There nearly always is one.
bool EventLogReader::is_sure_record() const noexcept {
  constexpr std::size_t kSyncBytes = sizeof kEventLogSync;
  if (available() < kEventLogHeaderBytes || !is_sync(at(0))) return false;
  const Lengths lengths = lengths_of(at(0));
  if (!lengths.plausible()) return false;
  const std::size_t length = lengths.record();
  return length + kSyncBytes <= available() && is_sync(at(length));
}

EventLogReader::Next EventLogReader::look_for(LogEventView& event) {
  if (is_sure_record()) {
    take(event);
    return Next::kEvent;
  }
  while (ensure(1)) {
    if (kept_ != kNothingKept && place() - looked_from_ > kDamageMostBytes) {
      looked_from_ = place();
      return Next::kFar;
    }
    std::size_t skip = 1;
    std::size_t length = 0;
    const Look look = look_at(0, length);
    if (look == Look::kRecord) {
      // A damaged length makes a record swallow those after it; then one of them shows inside.
      const auto inside = may_begin_record(length) ? std::nullopt : next_sure_record(0, length);
      if (!inside) {
        take(event);
        return Next::kEvent;
      }
      skip = *inside;
    } else if (look == Look::kCutOff) {
      const auto behind = next_sure_record(0, available());
      if (!behind) {
        bytes_cut_off_ = available();
        begin_ = end_;
        return Next::kEnd;
      }
      skip = *behind;
    }
    if (look == Look::kNoRecord) skip = next_sync(skip);
    begin_ += skip;
    bytes_skipped_ += skip;
  }
  return Next::kEnd;
}

void EventLogReader::go_to(std::uint64_t place) {
  begin_ = 0;
  end_ = 0;
  kept_ = kNothingKept;
  looked_from_ = place;
  read_ = place;
  file_.clear();
  file_.seekg(static_cast<std::streamoff>(place));
}

LogEventView EventLogReader::event_at(std::uint64_t place) const noexcept {
  return view_of(buffer_.data() + (place - (read_ - end_)));
}

void EventLogReader::take(LogEventView& event) {
  given_ = place();
  event = view_of(at(0));
  begin_ += lengths_of(at(0)).record();
  looked_from_ = place();
}

}  // namespace imuscope
