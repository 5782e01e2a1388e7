#pragma once

/// CDR as ROS 2 serialises its messages (XCDR1, plain): a head of four bytes that tells the byte order, then
/// fields at multiples of their size, counted from behind the head. Read as ROS 1 writes them, too.

#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

#include "logs/mcap/records.h"

namespace imuscope::mcap {

/// Bytes before the fields: representation identifier (big-endian, least bit: little-endian) and two bytes of
/// options.
inline constexpr std::size_t kCdrHead = 4;

/// Writes one message after the other into the same buffer; little-endian.
class CdrWriter {
 public:
  void begin();
  template <typename Number>
  void number(Number value) {
    align<sizeof value>();
    std::array<char, sizeof value> bytes;
    std::memcpy(bytes.data(), &value, sizeof value);
    out_.append(bytes.data(), bytes.size());
  }
  template <std::size_t N>
  void numbers(const std::array<double, N>& values) {
    align<sizeof(double)>();
    std::array<char, sizeof values> bytes;
    std::memcpy(bytes.data(), values.data(), sizeof values);
    out_.append(bytes.data(), bytes.size());
  }
  void text(std::string_view text);
  [[nodiscard]] Bytes bytes() const { return bytes_of(out_); }

 private:
  template <std::size_t Size>
  void align() {
    const std::size_t over = (out_.size() - kCdrHead) % Size;
    if (over > 0) out_.append(Size - over, '\0');
  }
  std::string out_;
};

/// How the fields of a message of ROS lie in its bytes.
enum class Wire : std::uint8_t {
  kCdr,   ///< ROS 2
  kRos1,  ///< one after the other, little-endian, no head, no zero after texts
};

/// Takes fields one after the other; what is asked for beyond the end is zero, and good() says so.
class CdrReader {
 public:
  explicit CdrReader(Bytes message, Wire wire = Wire::kCdr) noexcept;
  template <typename Number>
  [[nodiscard]] Number number() noexcept {
    align(sizeof(Number));
    std::array<std::uint8_t, sizeof(Number)> bytes{};
    if (body_.size() - at_ < sizeof(Number)) {
      good_ = false;
      at_ = body_.size();
      return Number{};
    }
    for (std::size_t i = 0; i < sizeof(Number); ++i)
      bytes[swap_ ? sizeof(Number) - 1 - i : i] = body_[at_ + i];
    at_ += sizeof(Number);
    return std::bit_cast<Number>(bytes);
  }
  template <std::size_t N>
  [[nodiscard]] std::array<double, N> numbers() noexcept {
    std::array<double, N> values{};
    for (double& value : values) value = number<double>();
    return values;
  }
  [[nodiscard]] std::string_view text() noexcept;
  [[nodiscard]] bool good() const noexcept { return good_; }
  [[nodiscard]] Wire wire() const noexcept { return wire_; }

 private:
  void align(std::size_t size) noexcept;
  Wire wire_;
  Bytes body_;
  std::size_t at_ = 0;
  bool swap_ = false;
  bool good_ = true;
};

}  // namespace imuscope::mcap
