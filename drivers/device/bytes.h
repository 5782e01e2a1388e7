#pragma once

/// Numbers out of bytes, by shifting: no overlay, so alignment and the host's byte order do not matter.

#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

namespace imuscope {

namespace detail {
template <std::size_t Size>
using UnsignedOfSize =
    std::conditional_t<Size == 1, std::uint8_t,
                       std::conditional_t<Size == 2, std::uint16_t,
                                          std::conditional_t<Size == 4, std::uint32_t, std::uint64_t>>>;
}  // namespace detail

/// Most significant byte first. T is an integer or a floating point type of 1, 2, 4 or 8 bytes; `bytes` holds
/// at least sizeof(T) behind `offset` (the caller has checked the length of the frame).
template <typename T>
[[nodiscard]] T read_be(std::span<const std::uint8_t> bytes, std::size_t offset = 0) noexcept {
  using Raw = detail::UnsignedOfSize<sizeof(T)>;
  std::uint64_t raw = 0;
  for (std::size_t i = 0; i < sizeof(T); ++i) raw = raw << 8U | bytes[offset + i];
  return std::bit_cast<T>(static_cast<Raw>(raw));
}

/// Least significant byte first; otherwise as read_be().
template <typename T>
[[nodiscard]] T read_le(std::span<const std::uint8_t> bytes, std::size_t offset = 0) noexcept {
  using Raw = detail::UnsignedOfSize<sizeof(T)>;
  std::uint64_t raw = 0;
  for (std::size_t i = sizeof(T); i-- > 0;) raw = raw << 8U | bytes[offset + i];
  return std::bit_cast<T>(static_cast<Raw>(raw));
}

}  // namespace imuscope
