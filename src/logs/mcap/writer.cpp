#include "logs/mcap/writer.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace imuscope::mcap {
namespace {

/// One record: `fields` writes its content.
template <typename Fields>
std::string record(Opcode opcode, Fields&& fields) {
  std::string out;
  RecordWriter writer(out);
  const auto begun = writer.begin(opcode);
  fields(writer);
  writer.end(begun);
  return out;
}

std::string joined(const std::vector<std::string>& records) {
  return std::accumulate(records.begin(), records.end(), std::string());
}

}  // namespace

Writer::Writer(WriterOptions options, Sink sink)
    : options_(std::move(options)), sink_(std::move(sink)), packer_(options_.compression) {
  put(text_of(kMagic));
  put(record(Opcode::kHeader, [this](RecordWriter& writer) {
    writer.text(options_.profile);
    writer.text(options_.library);
  }));
}

void Writer::put(std::string_view bytes) {
  crc_ = crc32_of(bytes_of(bytes), crc_);
  position_ += bytes.size();
  sink_(bytes);
}

SchemaId Writer::add_schema(const std::string& name, const std::string& encoding, const std::string& text) {
  const auto id = static_cast<SchemaId>(schemas_.size() + 1);
  schemas_.push_back(record(Opcode::kSchema, [&](RecordWriter& writer) {
    writer.number(id);
    writer.text(name);
    writer.text(encoding);
    writer.text(text);
  }));
  return id;
}

ChannelId Writer::add_channel(const std::string& topic, SchemaId schema, const std::string& encoding,
                              const Texts& metadata) {
  const auto id = static_cast<ChannelId>(channels_.size() + 1);
  Channel channel;
  channel.schema = schema;
  channel.record = record(Opcode::kChannel, [&](RecordWriter& writer) {
    writer.number(id);
    writer.number(schema);
    writer.text(topic);
    writer.text(encoding);
    writer.texts(metadata);
  });
  channels_.push_back(std::move(channel));
  return id;
}

/// Before the first message of a channel stand its schema and itself.
void Writer::define(Channel& channel) {
  if (channel.is_written) return;
  channel.is_written = true;
  if (channel.schema != 0 && schemas_written_.insert(channel.schema).second)
    chunk_ += schemas_[channel.schema - 1U];
  chunk_ += channel.record;
}

void Writer::write(ChannelId id, std::uint64_t log_time, std::uint64_t publish_time, Bytes data) {
  Channel& channel = channels_[id - 1U];
  define(channel);
  RecordWriter index(channel.index);
  index.number(log_time);
  index.number(static_cast<std::uint64_t>(chunk_.size()));
  RecordWriter writer(chunk_);
  constexpr std::size_t kFields = 2 + 4 + 8 + 8;
  writer.number(static_cast<std::uint8_t>(Opcode::kMessage));
  writer.number(static_cast<std::uint64_t>(kFields + data.size()));
  writer.number(id);
  writer.number(channel.sequence++);
  writer.number(log_time);
  writer.number(publish_time);
  writer.bytes(text_of(data));
  ++channel.messages;
  chunk_begin_ = chunk_has_message_ ? std::min(chunk_begin_, log_time) : log_time;
  chunk_end_ = chunk_has_message_ ? std::max(chunk_end_, log_time) : log_time;
  chunk_has_message_ = true;
  begin_time_ = messages_ == 0 ? log_time : std::min(begin_time_, log_time);
  end_time_ = std::max(end_time_, log_time);
  ++messages_;
  if (chunk_.size() < options_.chunk_bytes) return;
  hand_over();
  if (!options_.packs_beside) write_out();
}

void Writer::end_chunk() {
  hand_over();
  write_out();
}

/// The chunk that was filled begins to be packed; the one before it goes into the file.
void Writer::hand_over() {
  if (!chunk_has_message_) return;
  write_out();
  has_full_ = true;
  full_.entry = ChunkEntry{};
  full_.entry.begin_time = chunk_begin_;
  full_.entry.end_time = chunk_end_;
  full_.entry.unpacked = chunk_.size();
  full_.content.swap(chunk_);
  chunk_.clear();
  chunk_has_message_ = false;
  full_.indexes.resize(channels_.size());
  for (std::size_t i = 0; i < channels_.size(); ++i) {
    full_.indexes[i].swap(channels_[i].index);
    channels_[i].index.clear();
  }
  full_.is_packed = std::async(options_.packs_beside ? std::launch::async : std::launch::deferred, [this] {
    packer_.pack(full_.content, full_.packed);
    full_.crc = crc32_of(bytes_of(full_.content));
  });
}

void Writer::write_out() {
  if (!std::exchange(has_full_, false)) return;
  full_.is_packed.get();
  ChunkEntry& entry = full_.entry;
  entry.offset = position_;
  entry.packed = full_.packed.size();
  put(record(Opcode::kChunk, [&](RecordWriter& writer) {
    writer.number(entry.begin_time);
    writer.number(entry.end_time);
    writer.number(entry.unpacked);
    writer.number(full_.crc);
    writer.text(name_of(options_.compression));
    writer.number(static_cast<std::uint64_t>(full_.packed.size()));
    writer.bytes(full_.packed);
  }));
  entry.length = position_ - entry.offset;
  for (std::size_t i = 0; i < full_.indexes.size(); ++i) {
    if (full_.indexes[i].empty()) continue;
    const auto id = static_cast<ChannelId>(i + 1);
    entry.index_offsets[id] = position_;
    put(record(Opcode::kMessageIndex, [&](RecordWriter& writer) {
      writer.number(id);
      writer.text(full_.indexes[i]);
    }));
  }
  entry.index_length = position_ - entry.offset - entry.length;
  chunks_.push_back(std::move(entry));
}

void Writer::attach(const std::string& name, const std::string& media_type, std::uint64_t time,
                    std::string_view data) {
  end_chunk();
  const std::uint64_t offset = position_;
  put(record(Opcode::kAttachment, [&](RecordWriter& writer) {
    std::string content;
    RecordWriter fields(content);
    fields.number(time);
    fields.number(time);
    fields.text(name);
    fields.text(media_type);
    fields.number(static_cast<std::uint64_t>(data.size()));
    fields.bytes(data);
    writer.bytes(content);
    writer.number(crc32_of(bytes_of(content)));
  }));
  attachment_indexes_.push_back(record(Opcode::kAttachmentIndex, [&](RecordWriter& writer) {
    writer.number(offset);
    writer.number(position_ - offset);
    writer.number(time);
    writer.number(time);
    writer.number(static_cast<std::uint64_t>(data.size()));
    writer.text(name);
    writer.text(media_type);
  }));
}

void Writer::add_metadata(const std::string& name, const Texts& texts) {
  end_chunk();
  const std::uint64_t offset = position_;
  put(record(Opcode::kMetadata, [&](RecordWriter& writer) {
    writer.text(name);
    writer.texts(texts);
  }));
  metadata_indexes_.push_back(record(Opcode::kMetadataIndex, [&](RecordWriter& writer) {
    writer.number(offset);
    writer.number(position_ - offset);
    writer.text(name);
  }));
}

/// @param offsets  receives the summary offsets, which follow it
std::string Writer::summary(std::string& offsets) const {
  std::string out;
  const auto group = [&](Opcode opcode, const std::string& records) {
    if (records.empty()) return;
    offsets += record(Opcode::kSummaryOffset, [&](RecordWriter& writer) {
      writer.number(static_cast<std::uint8_t>(opcode));
      writer.number(position_ + out.size());
      writer.number(static_cast<std::uint64_t>(records.size()));
    });
    out += records;
  };
  group(Opcode::kSchema, joined(schemas_));
  std::string channels;
  for (const auto& channel : channels_) channels += channel.record;
  group(Opcode::kChannel, channels);
  group(Opcode::kStatistics, record(Opcode::kStatistics, [this](RecordWriter& writer) {
          writer.number(messages_);
          writer.number(static_cast<std::uint16_t>(schemas_.size()));
          writer.number(static_cast<std::uint32_t>(channels_.size()));
          writer.number(static_cast<std::uint32_t>(attachment_indexes_.size()));
          writer.number(static_cast<std::uint32_t>(metadata_indexes_.size()));
          writer.number(static_cast<std::uint32_t>(chunks_.size()));
          writer.number(begin_time_);
          writer.number(end_time_);
          std::string counts;
          RecordWriter map(counts);
          for (std::size_t i = 0; i < channels_.size(); ++i) {
            map.number(static_cast<ChannelId>(i + 1));
            map.number(channels_[i].messages);
          }
          writer.text(counts);
        }));
  std::string chunks;
  for (const auto& entry : chunks_) {
    chunks += record(Opcode::kChunkIndex, [&](RecordWriter& writer) {
      writer.number(entry.begin_time);
      writer.number(entry.end_time);
      writer.number(entry.offset);
      writer.number(entry.length);
      std::string indexes;
      RecordWriter map(indexes);
      for (const auto& [channel, offset] : entry.index_offsets) {
        map.number(channel);
        map.number(offset);
      }
      writer.text(indexes);
      writer.number(entry.index_length);
      writer.text(name_of(options_.compression));
      writer.number(entry.packed);
      writer.number(entry.unpacked);
    });
  }
  group(Opcode::kChunkIndex, chunks);
  group(Opcode::kAttachmentIndex, joined(attachment_indexes_));
  group(Opcode::kMetadataIndex, joined(metadata_indexes_));
  return out;
}

void Writer::finish() {
  end_chunk();
  put(record(Opcode::kDataEnd, [this](RecordWriter& writer) { writer.number(crc_); }));
  std::string offsets;
  std::string end = summary(offsets);
  const std::uint64_t summary_start = position_;
  const std::uint64_t offsets_start = position_ + end.size();
  end += offsets;
  std::string footer;
  RecordWriter writer(footer);
  writer.number(static_cast<std::uint8_t>(Opcode::kFooter));
  writer.number(static_cast<std::uint64_t>(kFooterContent));
  writer.number(summary_start);
  writer.number(offsets_start);
  end += footer;
  std::string crc;
  RecordWriter(crc).number(crc32_of(bytes_of(end)));
  put(end + crc);
  put(text_of(kMagic));
}

}  // namespace imuscope::mcap
