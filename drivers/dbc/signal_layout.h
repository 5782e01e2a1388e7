#pragma once

/// Where a signal's bits stand in a frame and what they mean. Core: no allocation, noexcept.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace imuscope::dbc {

enum class ByteOrder : std::uint8_t {
  kIntel,     ///< start = least significant bit, the next bit is one higher
  kMotorola,  ///< start = most significant bit; from bit 0 of a byte on to bit 7 of the byte after it
};
enum class Coding : std::uint8_t { kUnsigned, kSigned, kFloat, kDouble };

/// Bit n of a frame is bit n % 8 of byte n / 8, bit 0 being a byte's least significant one.
struct SignalLayout {
  std::uint16_t start = 0;
  std::uint16_t length = 1;  ///< bits, 1 to 64
  ByteOrder order = ByteOrder::kIntel;
  Coding coding = Coding::kUnsigned;
  double factor = 1.0;  ///< value = number in the frame * factor + offset
  double offset = 0.0;
};

/// Bytes that a frame must have for the signal to be in it.
[[nodiscard]] std::size_t bytes_needed(const SignalLayout& layout) noexcept;

/// The signal's bits as they are in the frame; nothing where the frame is too short.
[[nodiscard]] std::optional<std::uint64_t> raw_of(const SignalLayout& layout,
                                                  std::span<const std::uint8_t> data) noexcept;

/// Two's complement over the signal's length.
[[nodiscard]] std::int64_t signed_of(const SignalLayout& layout, std::uint64_t raw) noexcept;

/// Value in the signal's own unit. Integers beyond 2^53 lose their last bits here: use raw_of() for stamps.
[[nodiscard]] double value_of(const SignalLayout& layout, std::uint64_t raw) noexcept;

}  // namespace imuscope::dbc
