#pragma once

/// Reads the messages of a bag of ROS 1 (version 2.0) in their order in it: chunks packed by lz4 or bzip2 or
/// not at all, with and without index, and as far as it goes where the bag is damaged or was cut off. Every
/// length is held against the file's before memory is made.
///
/// Non-real-time: allocates. Thread: one.

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "logs/mcap/message_reader.h"

namespace imuscope::rosbag {

/// First line of a bag; only this version has ever been in use since 2010.
inline constexpr std::string_view kMagic = "#ROSBAG V2.0\n";

class Reader final : public mcap::MessageReader {
 public:
  /// Errors (kWork): a file that cannot be read or is no bag of this version.
  static Result<Reader> open(const std::filesystem::path& file);

  std::optional<mcap::Message> next() override;
  [[nodiscard]] std::vector<std::string> losses() const override;
  [[nodiscard]] std::uint64_t bytes_read() const noexcept override { return position_; }
  [[nodiscard]] std::uint64_t bytes_total() const noexcept override { return size_; }

 private:
  struct Loss {
    std::uint64_t chunks = 0;
    std::uint64_t messages = 0;
    std::uint64_t bytes = 0;
    std::string first_why;
    bool cut_off = false;
  };
  Reader(std::ifstream in, std::uint64_t size, std::string name);
  void find_chunks();
  bool read_record();
  void go_to(std::uint64_t position);
  void go_on_after_damage(std::uint64_t from);
  void take_chunk(std::string_view header, mcap::Bytes packed, bool is_whole);
  void lose_chunk(std::string why);
  void take_connection(std::string_view header, mcap::Bytes data);
  std::optional<mcap::Message> take_message(std::string_view header, mcap::Bytes data);

  std::ifstream in_;
  std::uint64_t size_;
  std::string name_;
  std::uint64_t position_ = kMagic.size();
  std::uint64_t unpacked_ = 0;
  std::uint64_t definitions_ = 0;
  bool at_end_ = false;
  bool has_index_ = false;
  std::vector<std::uint64_t> chunk_offsets_;  ///< of the index, where there is one; rising
  std::map<std::uint32_t, std::unique_ptr<mcap::Topic>> topics_;
  std::string header_;
  std::string data_;
  std::string chunk_;  ///< unpacked
  mcap::Bytes rest_of_chunk_;
  std::optional<mcap::Message> single_;  ///< outside a chunk
  Loss loss_;
};

}  // namespace imuscope::rosbag
