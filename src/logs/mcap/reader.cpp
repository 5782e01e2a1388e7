#include "logs/mcap/reader.h"

#include <fmt/format.h>
#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

namespace imuscope::mcap {
namespace {

/// Magic of a file of which the beginning is there.
bool begins_as_mcap(std::ifstream& in) {
  std::array<char, kMagic.size()> magic{};
  in.read(magic.data(), magic.size());
  return in.gcount() == static_cast<std::streamsize>(magic.size()) &&
         std::memcmp(magic.data(), kMagic.data(), magic.size()) == 0;
}

}  // namespace

Result<Reader> Reader::open(const std::filesystem::path& file) {
  const std::string name = file.string();
  std::error_code error;
  if (!std::filesystem::exists(file, error)) return work_error(fmt::format("{}: no such file", name));
  if (!std::filesystem::is_regular_file(file, error)) {
    return work_error(fmt::format("{}: is no file", name),
                      "give an MCAP file; of a folder of rosbag2 the .mcap in it");
  }
  std::ifstream in(file, std::ios::binary);
  if (!in) return work_error(fmt::format("{}: cannot be read ({})", name, std::strerror(errno)));
  if (!begins_as_mcap(in))
    return work_error(fmt::format("{}: is no MCAP file", name), "check how it was made");
  const std::uint64_t size = std::filesystem::file_size(file, error);
  Reader reader(std::move(in), error ? 0 : size, name);
  reader.find_chunks();
  return reader;
}

Reader::Reader(std::ifstream in, std::uint64_t size, std::string name)
    : in_(std::move(in)), size_(size), name_(std::move(name)), position_(kMagic.size()) {}

void Reader::skip(std::uint64_t n) {
  position_ += n;
  in_.seekg(static_cast<std::streamoff>(position_));
}

/// Where the summary says that chunks begin: the way on after damage.
void Reader::find_chunks() {
  constexpr std::uint64_t kEnd = kRecordHead + kFooterContent + kMagic.size();
  if (size_ >= kMagic.size() + kEnd) {
    in_.seekg(static_cast<std::streamoff>(size_ - kEnd));
    std::string end;
    if (read_exactly(in_, kEnd, end)) {
      const auto footer = record_at(bytes_of(end));
      has_footer_ = footer && footer->opcode == Opcode::kFooter && footer->content.size() == kFooterContent &&
                    std::memcmp(end.data() + footer->size, kMagic.data(), kMagic.size()) == 0;
      if (has_footer_) {
        const auto start = RecordReader(footer->content).number<std::uint64_t>();
        const std::uint64_t end_at = size_ - kEnd;
        std::string summary;
        if (start >= kMagic.size() && start < end_at && end_at - start <= kSummaryMost) {
          in_.seekg(static_cast<std::streamoff>(start));
          (void)read_exactly(in_, end_at - start, summary);
        }
        Bytes rest = bytes_of(summary);
        for (auto record = record_at(rest); record; record = record_at(rest)) {
          if (record->opcode == Opcode::kChunkIndex) {
            RecordReader fields(record->content);
            (void)fields.bytes(2 * sizeof(std::uint64_t));
            const auto offset = fields.number<std::uint64_t>();
            if (fields.good()) chunk_offsets_.push_back(offset);
          }
          rest = rest.subspan(record->size);
        }
      }
    }
  }
  std::sort(chunk_offsets_.begin(), chunk_offsets_.end());
  in_.clear();
  in_.seekg(static_cast<std::streamoff>(position_));
}

bool Reader::go_on_after_damage(std::uint64_t from) {
  const auto next = std::upper_bound(chunk_offsets_.begin(), chunk_offsets_.end(), from);
  if (next == chunk_offsets_.end() || *next >= size_) {
    loss_.bytes += size_ - std::min(size_, from);
    position_ = size_;
    at_end_ = true;
    return false;
  }
  loss_.bytes += *next - from;
  position_ = *next;
  in_.seekg(static_cast<std::streamoff>(position_));
  return true;
}

/// One record of the file. False at the end of the messages.
bool Reader::read_record() {
  const std::uint64_t begin = position_;
  std::string head;
  if (!read_exactly(in_, kRecordHead, head)) {
    loss_.cut_off = true;
    return false;
  }
  RecordReader fields(bytes_of(head));
  const auto opcode = static_cast<Opcode>(fields.number<std::uint8_t>());
  const auto length = fields.number<std::uint64_t>();
  const std::uint64_t left = size_ - std::min(size_, begin + kRecordHead);
  if (opcode == Opcode::kDataEnd || opcode == Opcode::kFooter) return false;
  const bool is_known = opcode >= Opcode::kHeader && opcode <= Opcode::kDataEnd;
  constexpr std::uint8_t kFirstPrivate = 0x80;
  if (!is_known && static_cast<std::uint8_t>(opcode) < kFirstPrivate) return go_on_after_damage(begin);
  // What is cut off at the end of the file is damage where the file goes on by its index.
  const bool is_cut = length > left;
  if (is_cut && has_footer_) return go_on_after_damage(begin);
  position_ = begin + kRecordHead;
  if (is_cut) loss_.cut_off = true;
  const bool is_wanted = opcode == Opcode::kChunk || opcode == Opcode::kMessage ||
                         opcode == Opcode::kSchema || opcode == Opcode::kChannel || opcode == Opcode::kHeader;
  const std::uint64_t there = std::min(length, left);
  if (!is_wanted || there > kChunkMost) {
    if (opcode == Opcode::kChunk) lose_chunk(fmt::format("of {} bytes, more than is read", length));
    if (opcode == Opcode::kMessage) ++loss_.messages;
    skip(there);
    return !is_cut;
  }
  (void)read_exactly(in_, there, record_);
  position_ += record_.size();
  const Bytes content = bytes_of(record_);
  if (opcode == Opcode::kChunk) take_chunk(content, !is_cut);
  if (!is_cut && opcode == Opcode::kMessage) single_ = content;
  if (!is_cut) take_definition({opcode, content, content.size()});
  return !is_cut || !rest_of_chunk_.empty();
}

void Reader::lose_chunk(std::string why) {
  ++loss_.chunks;
  if (loss_.first_why.empty()) loss_.first_why = std::move(why);
}

void Reader::take_chunk(Bytes content, bool is_whole) {
  RecordReader fields(content);
  (void)fields.bytes(2 * sizeof(std::uint64_t));
  const auto size = fields.number<std::uint64_t>();
  const auto crc = fields.number<std::uint32_t>();
  const auto name = fields.text();
  const auto packed_size = fields.number<std::uint64_t>();
  if (!fields.good()) return lose_chunk("its head is damaged");
  const auto compression = compression_of(name);
  if (!compression)
    return lose_chunk(fmt::format("packed by '{}', which nobody here unpacks", name.substr(0, 16)));
  if (size > kChunkMost) return lose_chunk(fmt::format("of {} bytes when unpacked, more than is read", size));
  if (unpacked_ + size > kUnpackedFree + kUnpackedShare * position_)
    return lose_chunk("unpacks to a thousand times the file's size");
  if (is_whole && packed_size > fields.rest().size()) return lose_chunk("its length is damaged");
  const Bytes packed = fields.rest().first(std::min<std::uint64_t>(packed_size, fields.rest().size()));
  const bool all = unpack(*compression, packed, size, chunk_);
  unpacked_ += chunk_.size();
  if (is_whole && (!all || (crc != 0 && crc32_of(bytes_of(chunk_)) != crc)))
    return lose_chunk("fails its CRC");
  rest_of_chunk_ = bytes_of(chunk_);
}

void Reader::take_definition(const Record& record) {
  RecordReader fields(record.content);
  if (record.opcode == Opcode::kHeader) {
    profile_ = std::string(fields.text().substr(0, 64));
    return;
  }
  if (record.opcode != Opcode::kSchema && record.opcode != Opcode::kChannel) return;
  const auto id = fields.number<std::uint16_t>();
  definitions_ += record.content.size();
  if (definitions_ > kDefinitionsMost) return;
  if (record.opcode == Opcode::kSchema) {
    Schema schema{std::string(fields.text()), std::string(fields.text())};
    if (fields.good() && id != 0) schemas_.emplace(id, std::move(schema));
    return;
  }
  const auto schema_id = fields.number<std::uint16_t>();
  auto topic = std::make_unique<Topic>();
  topic->name = std::string(fields.text());
  topic->encoding = std::string(fields.text());
  if (!fields.good()) return;
  if (const auto schema = schemas_.find(schema_id); schema != schemas_.end()) {
    topic->schema = schema->second.name;
    topic->schema_encoding = schema->second.encoding;
  }
  // The first of an id holds: addresses of topics stay what they are.
  topics_.try_emplace(id, std::move(topic));
}

std::optional<Message> Reader::take_message(Bytes content) {
  RecordReader fields(content);
  const auto topic = topics_.find(fields.number<std::uint16_t>());
  (void)fields.number<std::uint32_t>();
  Message message;
  message.log_time = fields.number<std::uint64_t>();
  message.publish_time = fields.number<std::uint64_t>();
  message.data = fields.rest();
  if (!fields.good() || topic == topics_.end()) {
    ++loss_.messages;
    return std::nullopt;
  }
  message.topic = topic->second.get();
  return message;
}

std::optional<Message> Reader::next() {
  for (;;) {
    while (!rest_of_chunk_.empty()) {
      const auto record = record_at(rest_of_chunk_);
      if (!record) {
        if (!loss_.cut_off) ++loss_.messages;
        rest_of_chunk_ = {};
        break;
      }
      rest_of_chunk_ = rest_of_chunk_.subspan(record->size);
      take_definition(*record);
      if (record->opcode != Opcode::kMessage) continue;
      if (auto message = take_message(record->content)) return message;
    }
    if (at_end_) return std::nullopt;
    if (!read_record()) at_end_ = true;
    if (!single_.empty()) {
      const Bytes content = std::exchange(single_, Bytes{});
      if (auto message = take_message(content)) return message;
    }
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
  if (loss_.cut_off || (at_end_ && !has_footer_))
    losses.push_back(fmt::format("{}: is cut off; what stands before the cut is used", name_));
  return losses;
}

}  // namespace imuscope::mcap
