#pragma once

/// Numbers, texts and maps of MCAP records: little-endian, lengths before what they count.

#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <istream>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "logs/mcap/format.h"

namespace imuscope::mcap {

static_assert(std::endian::native == std::endian::little, "numbers are written as they lie in memory");

using Bytes = std::span<const std::uint8_t>;
using Texts = std::map<std::string, std::string>;

/// Reads `n` bytes; what there is, and false, where there are fewer. The stream can be read on in either case.
bool read_exactly(std::istream& in, std::uint64_t n, std::string& out);

/// Appends the fields of records.
class RecordWriter {
 public:
  explicit RecordWriter(std::string& out) : out_(out) {}
  template <typename Integer>
  void number(Integer value) {
    std::array<char, sizeof value> bytes;
    std::memcpy(bytes.data(), &value, sizeof value);
    out_.append(bytes.data(), bytes.size());
  }
  void text(std::string_view text);
  void texts(const Texts& texts);
  void bytes(std::string_view bytes) { out_.append(bytes); }
  /// Begins a record; its length is filled in by end().
  [[nodiscard]] std::size_t begin(Opcode opcode);
  void end(std::size_t begun);

 private:
  std::string& out_;
};

/// Takes fields from a record one after the other. What is asked for beyond its end is nothing, and good()
/// says so.
class RecordReader {
 public:
  explicit RecordReader(Bytes content) noexcept : rest_(content) {}
  template <typename Integer>
  [[nodiscard]] Integer number() noexcept {
    const Bytes taken = bytes(sizeof(Integer));
    std::uint64_t value = 0;
    for (std::size_t i = taken.size(); i-- > 0;) value = value << 8U | taken[i];
    return static_cast<Integer>(value);
  }
  /// The next `n` bytes; empty, and not good() any more, where there are fewer.
  [[nodiscard]] Bytes bytes(std::uint64_t n) noexcept;
  [[nodiscard]] std::string_view text() noexcept;
  [[nodiscard]] Bytes rest() const noexcept { return rest_; }
  [[nodiscard]] bool good() const noexcept { return good_; }

 private:
  Bytes rest_;
  bool good_ = true;
};

/// A record at the beginning of `bytes`; nothing where it is not whole.
struct Record {
  Opcode opcode{};
  Bytes content;
  std::size_t size = 0;  ///< with its head
};
[[nodiscard]] std::optional<Record> record_at(Bytes bytes) noexcept;

/// CRC-32 of zlib, which MCAP uses; `before` continues an earlier one.
[[nodiscard]] std::uint32_t crc32_of(Bytes bytes, std::uint32_t before = 0) noexcept;
[[nodiscard]] inline Bytes bytes_of(std::string_view text) noexcept {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}
[[nodiscard]] inline std::string_view text_of(Bytes bytes) noexcept {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace imuscope::mcap
