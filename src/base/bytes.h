#pragma once

/// Numbers out of bytes, by copying and turning them round: no overlay, so alignment and the host's byte
/// order do not matter. And the sums over bytes that several protocols end their frames with.

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>

namespace imuscope {

namespace detail {
template <std::size_t Size>
using UnsignedOfSize =
    std::conditional_t<Size == 1, std::uint8_t,
                       std::conditional_t<Size == 2, std::uint16_t,
                                          std::conditional_t<Size == 4, std::uint32_t, std::uint64_t>>>;

template <typename Raw>
constexpr Raw reversed(Raw raw) noexcept {
  if constexpr (sizeof(Raw) == 2) return __builtin_bswap16(raw);
  if constexpr (sizeof(Raw) == 4) return __builtin_bswap32(raw);
  if constexpr (sizeof(Raw) == 8) return __builtin_bswap64(raw);
  return raw;
}

template <typename T>
[[nodiscard]] T read_ordered(const std::uint8_t* at, std::endian order) noexcept {
  UnsignedOfSize<sizeof(T)> raw;
  std::memcpy(&raw, at, sizeof raw);
  return std::bit_cast<T>(order == std::endian::native ? raw : reversed(raw));
}
}  // namespace detail

/// Most significant byte first. T is an integer or a floating point type of 1, 2, 4 or 8 bytes; `bytes` holds
/// at least sizeof(T) after `offset` (the caller has checked the length of the frame).
template <typename T>
[[nodiscard]] T read_be(std::span<const std::uint8_t> bytes, std::size_t offset = 0) noexcept {
  return detail::read_ordered<T>(bytes.data() + offset, std::endian::big);
}

/// Least significant byte first; otherwise as read_be().
template <typename T>
[[nodiscard]] T read_le(std::span<const std::uint8_t> bytes, std::size_t offset = 0) noexcept {
  return detail::read_ordered<T>(bytes.data() + offset, std::endian::little);
}

/// Writes an integer, least significant byte first, `offset` bytes into `out`, which has room for it.
template <typename T>
void write_le(T value, std::span<std::uint8_t> out, std::size_t offset = 0) noexcept {
  for (std::size_t i = 0; i < sizeof(T); ++i) out[offset + i] = static_cast<std::uint8_t>(value >> (8 * i));
}

/// Sum of the bytes modulo 2^32, eight at a time.
[[nodiscard]] inline std::uint32_t sum_of_bytes(std::span<const std::uint8_t> bytes) noexcept {
  // Bytes are added in lanes of 16 bits, each of which holds 128 sums of two bytes.
  constexpr std::uint64_t kEvenBytes = 0x00FF00FF00FF00FFULL;
  constexpr std::size_t kWordsUntilFull = 128;
  constexpr std::size_t kWord = sizeof(std::uint64_t);
  constexpr std::uint64_t kEvenLanes = 0x0000FFFF0000FFFFULL;
  std::uint32_t sum = 0;
  const std::uint8_t* at = bytes.data();
  for (std::size_t words = bytes.size() / kWord; words > 0;) {
    const std::size_t n = std::min(words, kWordsUntilFull);
    std::uint64_t lanes = 0;
    for (const std::uint8_t* end = at + n * kWord; at != end; at += kWord) {
      std::uint64_t word;
      std::memcpy(&word, at, kWord);
      lanes += (word & kEvenBytes) + (word >> 8U & kEvenBytes);
    }
    lanes = (lanes & kEvenLanes) + (lanes >> 16U & kEvenLanes);
    sum += static_cast<std::uint32_t>(lanes + (lanes >> 32U));
    words -= n;
  }
  for (const std::uint8_t* end = bytes.data() + bytes.size(); at != end; ++at) sum += *at;
  return sum;
}

}  // namespace imuscope
