#pragma once

/// Reads the messages of an MCAP file in their order in it: with and without index, in chunks or not, and as
/// far as it goes where it is damaged or was cut off. Every length is held against the file's before memory
/// is made.
///
/// Non-real-time: allocates. Thread: one.

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "logs/mcap/compression.h"
#include "logs/mcap/message_reader.h"

namespace imuscope::mcap {

class Reader final : public MessageReader {
 public:
  /// Errors (kWork): a file that cannot be read or is no MCAP file.
  static Result<Reader> open(const std::filesystem::path& file);

  std::optional<Message> next() override;
  [[nodiscard]] std::vector<std::string> losses() const override;
  [[nodiscard]] const std::string& profile() const noexcept { return profile_; }
  [[nodiscard]] std::uint64_t bytes_read() const noexcept override { return position_; }
  [[nodiscard]] std::uint64_t bytes_total() const noexcept override { return size_; }

 private:
  struct Loss {
    std::uint64_t chunks = 0;    ///< that could not be unpacked or failed their CRC
    std::uint64_t messages = 0;  ///< of a channel that nobody defined, or of a length that cannot be
    std::string first_why;
    std::uint64_t bytes = 0;  ///< that were passed over
    bool cut_off = false;     ///< the file ends in a record, or without a footer
  };
  explicit Reader(std::ifstream in, std::uint64_t size, std::string name);
  bool read_record();
  void skip(std::uint64_t n);
  void find_chunks();
  bool go_on_after_damage(std::uint64_t from);
  void take_chunk(Bytes content, bool is_whole);
  void lose_chunk(std::string why);
  void take_definition(const Record& record);
  std::optional<Message> take_message(Bytes content);

  std::ifstream in_;
  std::uint64_t size_;
  std::string name_;
  std::string profile_;
  std::uint64_t position_ = 0;  ///< of the next record in the file
  std::uint64_t unpacked_ = 0;
  std::uint64_t definitions_ = 0;
  bool at_end_ = false;
  bool has_footer_ = false;
  std::vector<std::uint64_t> chunk_offsets_;  ///< of the index, where there is one; rising
  struct Schema {
    std::string name;
    std::string encoding;
  };
  std::map<std::uint16_t, Schema> schemas_;
  std::map<std::uint16_t, std::unique_ptr<Topic>> topics_;
  std::string record_;   ///< content of the record that was read
  std::string chunk_;    ///< unpacked
  Bytes rest_of_chunk_;  ///< after the message that was handed out
  Bytes single_;         ///< a message outside a chunk
  Loss loss_;
};

}  // namespace imuscope::mcap
