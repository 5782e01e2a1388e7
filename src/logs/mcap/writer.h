#pragma once

/// Writes an MCAP file: messages in packed chunks, indexes of messages, chunks, attachments and metadata,
/// statistics, all CRCs. What was written before a cut of the power is read without the index.
///
/// Non-real-time: allocates. Thread: one, and one more for packing where that is asked for.

#include <cstdint>
#include <functional>
#include <future>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "logs/mcap/compression.h"
#include "logs/mcap/records.h"

namespace imuscope::mcap {

using SchemaId = std::uint16_t;
using ChannelId = std::uint16_t;

/// How a file is made.
struct WriterOptions {
  std::string profile;  ///< "ros2": CDR and ros2msg; empty: none
  std::string library;  ///< the program
  Compression compression = Compression::kZstd;
  std::size_t chunk_bytes = std::size_t{1} << 20U;  ///< of a chunk before it is packed, about
  bool packs_beside = false;  ///< a chunk is packed by a thread of its own while the next one is filled
};

class Writer {
 public:
  /// Takes the bytes of the file one after the other.
  using Sink = std::function<void(std::string_view bytes)>;

  Writer(WriterOptions options, Sink sink);

  /// @param encoding  "ros2msg", "jsonschema"
  SchemaId add_schema(const std::string& name, const std::string& encoding, const std::string& text);
  /// @param encoding  "cdr", "json"
  ChannelId add_channel(const std::string& topic, SchemaId schema, const std::string& encoding,
                        const Texts& metadata = {});
  /// Times are ns since 1970-01-01.
  void write(ChannelId channel, std::uint64_t log_time, std::uint64_t publish_time, Bytes data);
  void attach(const std::string& name, const std::string& media_type, std::uint64_t time,
              std::string_view data);
  void add_metadata(const std::string& name, const Texts& texts);
  /// What has been written so far is in the file and can be read, whatever happens.
  void end_chunk();
  /// Completes the file. No other call after it.
  void finish();

  [[nodiscard]] std::uint64_t messages() const noexcept { return messages_; }

 private:
  struct Channel {
    std::string record;
    SchemaId schema = 0;
    std::uint32_t sequence = 0;
    std::uint64_t messages = 0;
    bool is_written = false;
    std::string index;  ///< of the chunk that is filled: log times and offsets
  };
  struct ChunkEntry {
    std::uint64_t begin_time = 0;
    std::uint64_t end_time = 0;
    std::uint64_t offset = 0;
    std::uint64_t length = 0;
    std::map<ChannelId, std::uint64_t> index_offsets;
    std::uint64_t index_length = 0;
    std::uint64_t packed = 0;
    std::uint64_t unpacked = 0;
  };
  /// A chunk that is full, on its way into the file.
  struct FullChunk {
    ChunkEntry entry;
    std::string content;
    std::vector<std::string> indexes;  ///< by channel
    std::string packed;
    std::uint32_t crc = 0;
    std::future<void> is_packed;
  };
  void put(std::string_view bytes);
  void hand_over();
  void write_out();
  void define(Channel& channel);
  std::string summary(std::string& offsets) const;

  WriterOptions options_;
  Sink sink_;
  Packer packer_;
  std::uint64_t position_ = 0;
  std::uint32_t crc_ = 0;
  std::vector<std::string> schemas_;  ///< records, by id - 1
  std::set<SchemaId> schemas_written_;
  std::vector<Channel> channels_;  ///< by id - 1
  std::string chunk_;
  std::uint64_t chunk_begin_ = 0;
  std::uint64_t chunk_end_ = 0;
  bool chunk_has_message_ = false;
  std::vector<ChunkEntry> chunks_;
  std::vector<std::string> attachment_indexes_;
  std::vector<std::string> metadata_indexes_;
  std::uint64_t messages_ = 0;
  std::uint64_t begin_time_ = 0;
  std::uint64_t end_time_ = 0;
  FullChunk full_;
  bool has_full_ = false;
};

}  // namespace imuscope::mcap
