#include "logs/rosbag/reader.h"

#include <fmt/format.h>
#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "base/text.h"
#include "logs/mcap/compression.h"
#include "logs/mcap/format.h"
#include "logs/rosbag/bunzip.h"

namespace imuscope::rosbag {
namespace {

using mcap::Bytes;
using mcap::bytes_of;
using mcap::text_of;

/// Kinds of records, of http://wiki.ros.org/Bags/Format/2.0.
enum Op : std::uint8_t {
  kMessage = 2,
  kBagHeader = 3,
  kIndex = 4,
  kChunk = 5,
  kChunkInfo = 6,
  kConnection = 7
};

/// Headers name a topic at most.
constexpr std::uint32_t kHeaderMost = 64 * 1024;
/// A connection's header holds the type's definition.
constexpr std::uint32_t kConnectionMost = std::uint32_t{4} << 20U;
constexpr std::uint64_t kNsPerS = 1'000'000'000;

/// A length, and as many bytes, off the front.
std::optional<Bytes> take_sized(Bytes& rest) {
  mcap::RecordReader fields(rest);
  const auto length = fields.number<std::uint32_t>();
  const Bytes taken = fields.bytes(length);
  if (!fields.good()) return std::nullopt;
  rest = fields.rest();
  return taken;
}

/// The value of "name=value" in a header; nothing where there is none.
std::optional<Bytes> field(std::string_view header, std::string_view name) {
  Bytes rest = bytes_of(header);
  while (const auto one = take_sized(rest)) {
    const auto text = text_of(*one);
    if (text.size() > name.size() && text.starts_with(name) && text[name.size()] == '=')
      return one->subspan(name.size() + 1);
  }
  return std::nullopt;
}

template <typename Number>
std::optional<Number> number(std::string_view header, std::string_view name) {
  const auto value = field(header, name);
  if (!value || value->size() != sizeof(Number)) return std::nullopt;
  return mcap::RecordReader(*value).number<Number>();
}

std::string text(std::string_view header, std::string_view name) {
  const auto value = field(header, name);
  return value ? std::string(text_of(*value)) : std::string();
}

}  // namespace

Result<Reader> Reader::open(const std::filesystem::path& file) {
  const std::string name = file.string();
  std::error_code error;
  if (!std::filesystem::exists(file, error)) return work_error(fmt::format("{}: no such file", name));
  if (!std::filesystem::is_regular_file(file, error)) return work_error(fmt::format("{}: is no file", name));
  std::ifstream in(file, std::ios::binary);
  if (!in) return work_error(fmt::format("{}: cannot be read ({})", name, std::strerror(errno)));
  std::string magic(kMagic.size(), '\0');
  in.read(magic.data(), static_cast<std::streamsize>(magic.size()));
  if (magic != kMagic) {
    constexpr std::string_view kAnyVersion = "#ROS";
    return magic.starts_with(kAnyVersion)
               ? work_error(fmt::format("{}: is a bag of another version than 2.0", name),
                            "bring it up to date with rosbag fix")
               : work_error(fmt::format("{}: is no bag of ROS 1", name), "check how it was made");
  }
  const std::uint64_t size = std::filesystem::file_size(file, error);
  Reader reader(std::move(in), error ? 0 : size, name);
  reader.find_chunks();
  return reader;
}

Reader::Reader(std::ifstream in, std::uint64_t size, std::string name)
    : in_(std::move(in)), size_(size), name_(std::move(name)) {}

void Reader::go_to(std::uint64_t position) {
  position_ = position;
  in_.clear();
  in_.seekg(static_cast<std::streamoff>(position_));
}

/// Where the index says that chunks begin: the way on after damage.
void Reader::find_chunks() {
  std::string length;
  std::uint64_t index = 0;
  if (mcap::read_exactly(in_, sizeof(std::uint32_t), length)) {
    const auto n = mcap::RecordReader(bytes_of(length)).number<std::uint32_t>();
    if (n <= kHeaderMost && mcap::read_exactly(in_, n, header_))
      index = number<std::uint64_t>(header_, "index_pos").value_or(0);
  }
  has_index_ = index > kMagic.size() && index < size_;
  if (has_index_ && size_ - index <= mcap::kSummaryMost) {
    std::string summary;
    go_to(index);
    (void)mcap::read_exactly(in_, size_ - index, summary);
    Bytes rest = bytes_of(summary);
    for (;;) {
      const auto header = take_sized(rest);
      if (!header || !take_sized(rest)) break;
      if (number<std::uint8_t>(text_of(*header), "op") != kChunkInfo) continue;
      if (const auto offset = number<std::uint64_t>(text_of(*header), "chunk_pos"))
        chunk_offsets_.push_back(*offset);
    }
    std::sort(chunk_offsets_.begin(), chunk_offsets_.end());
  }
  go_to(kMagic.size());
}

void Reader::go_on_after_damage(std::uint64_t from) {
  const auto next = std::upper_bound(chunk_offsets_.begin(), chunk_offsets_.end(), from);
  const bool is_there = next != chunk_offsets_.end() && *next < size_;
  const std::uint64_t to = is_there ? *next : size_;
  loss_.bytes += to - std::min(to, from);
  at_end_ = !is_there;
  go_to(to);
}

/// One record of the file.
bool Reader::read_record() {
  const std::uint64_t begin = position_;
  if (begin >= size_) return false;
  std::string length;
  const auto read_length = [&](std::uint32_t most, std::uint32_t& n) {
    if (!mcap::read_exactly(in_, sizeof n, length)) return false;
    n = mcap::RecordReader(bytes_of(length)).number<std::uint32_t>();
    position_ += sizeof n;
    return n <= most;
  };
  const auto cut_or_damaged = [&](bool is_cut) {
    if (is_cut) {
      loss_.cut_off = true;
      position_ = size_;
      return false;
    }
    go_on_after_damage(begin);
    return !at_end_;
  };
  std::uint32_t n = 0;
  if (!read_length(kHeaderMost, n)) return cut_or_damaged(size_ - begin < 2 * sizeof n);
  if (!mcap::read_exactly(in_, n, header_))
    return cut_or_damaged(chunk_offsets_.empty() || begin > chunk_offsets_.back());
  position_ += n;
  const auto op = number<std::uint8_t>(header_, "op");
  if (!op || *op < kMessage || *op > kConnection) return cut_or_damaged(false);
  if (!read_length(~std::uint32_t{0}, n)) return cut_or_damaged(true);
  const std::uint64_t left = size_ - std::min(size_, position_);
  const bool is_cut = n > left;
  // What leads beyond the end is damage where the file goes on by its index.
  if (is_cut && std::upper_bound(chunk_offsets_.begin(), chunk_offsets_.end(), begin) != chunk_offsets_.end())
    return cut_or_damaged(false);
  const std::uint64_t there = std::min<std::uint64_t>(n, left);
  const bool is_wanted = *op == kChunk || *op == kConnection || *op == kMessage;
  if (is_cut) loss_.cut_off = true;
  if (!is_wanted || there > mcap::kChunkMost) {
    if (*op == kChunk) lose_chunk(fmt::format("of {} bytes, more than is read", n));
    if (*op == kMessage) ++loss_.messages;
    go_to(position_ + there);
    return !is_cut;
  }
  (void)mcap::read_exactly(in_, there, data_);
  position_ += data_.size();
  if (*op == kChunk) take_chunk(header_, bytes_of(data_), !is_cut);
  if (*op == kConnection && !is_cut) take_connection(header_, bytes_of(data_));
  if (*op == kMessage && !is_cut) single_ = take_message(header_, bytes_of(data_));
  return !is_cut || !rest_of_chunk_.empty();
}

void Reader::lose_chunk(std::string why) {
  ++loss_.chunks;
  if (loss_.first_why.empty()) loss_.first_why = std::move(why);
}

void Reader::take_chunk(std::string_view header, Bytes packed, bool is_whole) {
  const auto size = number<std::uint32_t>(header, "size");
  const std::string compression = text(header, "compression");
  if (!size) return lose_chunk("its head is damaged");
  if (*size > mcap::kChunkMost)
    return lose_chunk(fmt::format("of {} bytes when unpacked, more than is read", *size));
  if (unpacked_ + *size > mcap::kUnpackedFree + mcap::kUnpackedShare * position_)
    return lose_chunk("unpacks to a thousand times the file's size");
  bool all = false;
  if (compression == "none") {
    all = mcap::unpack(mcap::Compression::kNone, packed, *size, chunk_);
  } else if (compression == "lz4") {
    all = mcap::unpack(mcap::Compression::kLz4, packed, *size, chunk_);
  } else if (compression == "bz2") {
    all = bunzip(packed, *size, chunk_);
  } else {
    return lose_chunk(fmt::format("packed by '{}', which nobody here unpacks", one_line(compression, 16)));
  }
  unpacked_ += chunk_.size();
  // Bags have no checksums: messages before the damage are as good as any.
  if (is_whole && !all) lose_chunk("cannot be unpacked to its end");
  rest_of_chunk_ = bytes_of(chunk_);
}

void Reader::take_connection(std::string_view header, Bytes data) {
  const auto id = number<std::uint32_t>(header, "conn");
  if (!id || data.size() > kConnectionMost) return;
  definitions_ += data.size();
  if (definitions_ > mcap::kDefinitionsMost) return;
  auto topic = std::make_unique<mcap::Topic>();
  topic->name = text(header, "topic");
  topic->encoding = "ros1";
  topic->schema = text(text_of(data), "type");
  topic->schema_encoding = "ros1msg";
  // The first of an id holds: addresses of topics stay what they are.
  topics_.try_emplace(*id, std::move(topic));
}

std::optional<mcap::Message> Reader::take_message(std::string_view header, Bytes data) {
  const auto id = number<std::uint32_t>(header, "conn");
  const auto time = number<std::uint64_t>(header, "time");
  const auto topic = id ? topics_.find(*id) : topics_.end();
  if (!time || topic == topics_.end()) {
    ++loss_.messages;
    return std::nullopt;
  }
  constexpr unsigned kHalf = 32;
  mcap::Message message;
  message.topic = topic->second.get();
  message.log_time = (*time & 0xFFFF'FFFFU) * kNsPerS + (*time >> kHalf);
  message.publish_time = message.log_time;
  message.data = data;
  return message;
}

std::optional<mcap::Message> Reader::next() {
  for (;;) {
    while (!rest_of_chunk_.empty()) {
      const auto header = take_sized(rest_of_chunk_);
      const auto data = header ? take_sized(rest_of_chunk_) : std::nullopt;
      if (!data) {
        if (!loss_.cut_off) ++loss_.messages;
        rest_of_chunk_ = {};
        break;
      }
      const auto op = number<std::uint8_t>(text_of(*header), "op");
      if (op == kConnection) take_connection(text_of(*header), *data);
      if (op != kMessage) continue;
      if (auto message = take_message(text_of(*header), *data)) return message;
    }
    if (at_end_) return std::nullopt;
    if (!read_record()) at_end_ = true;
    if (single_) return std::exchange(single_, std::nullopt);
  }
}

std::vector<std::string> Reader::losses() const {
  std::vector<std::string> losses;
  if (loss_.chunks > 0) {
    losses.push_back(fmt::format("{}: {} chunks of messages cannot be read (the first {})", name_,
                                 loss_.chunks, loss_.first_why));
  }
  if (loss_.messages > 0) losses.push_back(fmt::format("{}: {} messages are damaged", name_, loss_.messages));
  if (loss_.bytes > 0)
    losses.push_back(fmt::format("{}: {} bytes are damaged and were passed over", name_, loss_.bytes));
  if (loss_.cut_off || !has_index_) {
    losses.push_back(
        fmt::format("{}: is cut off or was not closed (rosbag reindex would say so); "
                    "what stands before the cut is used",
                    name_));
  }
  return losses;
}

}  // namespace imuscope::rosbag
