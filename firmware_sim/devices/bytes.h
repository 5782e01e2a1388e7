#pragma once

/// Numbers into bytes, in either order.

#include <array>
#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <type_traits>
#include <vector>

namespace imusim {

using Bytes = std::vector<std::uint8_t>;

template <typename T>
concept WireNumber = std::integral<T> || std::floating_point<T>;

/// Appends a number, most significant byte first.
template <WireNumber T>
void put_be(Bytes& bytes, T value) {
  static_assert(std::endian::native == std::endian::little);
  const auto raw = std::bit_cast<std::array<std::uint8_t, sizeof(T)>>(value);
  bytes.insert(bytes.end(), raw.rbegin(), raw.rend());
}

/// Appends a number, least significant byte first.
template <WireNumber T>
void put_le(Bytes& bytes, T value) {
  const auto raw = std::bit_cast<std::array<std::uint8_t, sizeof(T)>>(value);
  bytes.insert(bytes.end(), raw.begin(), raw.end());
}

inline void put_bytes(Bytes& bytes, std::span<const std::uint8_t> more) {
  bytes.insert(bytes.end(), more.begin(), more.end());
}

inline void put_text(Bytes& bytes, std::string_view text) {
  bytes.insert(bytes.end(), text.begin(), text.end());
}

/// Reads a number, most significant byte first, from the front of at least sizeof(T) bytes.
template <std::unsigned_integral T>
T get_be(std::span<const std::uint8_t> bytes) {
  T value = 0;
  for (std::size_t i = 0; i < sizeof(T); ++i) value = static_cast<T>((value << 8U) | bytes[i]);
  return value;
}

}  // namespace imusim
