#include "drivers/dbc/signal_layout.h"

#include <bit>

namespace imuscope::dbc {
namespace {

constexpr std::size_t kBitsPerByte = 8;
constexpr std::uint16_t kRawBits = 64;

/// Position of a Motorola start bit when bits are counted in the order of transmission.
std::size_t transmitted_position(std::size_t start) noexcept {
  return start / kBitsPerByte * kBitsPerByte + (kBitsPerByte - 1 - start % kBitsPerByte);
}

}  // namespace

std::size_t bytes_needed(const SignalLayout& layout) noexcept {
  const std::size_t first =
      layout.order == ByteOrder::kIntel ? layout.start : transmitted_position(layout.start);
  return (first + layout.length - 1) / kBitsPerByte + 1;
}

std::optional<std::uint64_t> raw_of(const SignalLayout& layout, std::span<const std::uint8_t> data) noexcept {
  if (data.size() < bytes_needed(layout)) return std::nullopt;
  std::uint64_t raw = 0;
  if (layout.order == ByteOrder::kIntel) {
    for (std::size_t i = 0; i < layout.length; ++i) {
      const std::size_t at = layout.start + i;
      const std::uint64_t bit = data[at / kBitsPerByte] >> (at % kBitsPerByte) & 1U;
      raw |= bit << i;
    }
    return raw;
  }
  const std::size_t first = transmitted_position(layout.start);
  for (std::size_t i = 0; i < layout.length; ++i) {
    const std::size_t at = first + i;
    const std::uint64_t bit = data[at / kBitsPerByte] >> (kBitsPerByte - 1 - at % kBitsPerByte) & 1U;
    raw = raw << 1U | bit;
  }
  return raw;
}

std::int64_t signed_of(const SignalLayout& layout, std::uint64_t raw) noexcept {
  const unsigned unused = kRawBits - layout.length;
  // Shifting a negative number right keeps its sign: C++20.
  return static_cast<std::int64_t>(raw << unused) >> unused;
}

double value_of(const SignalLayout& layout, std::uint64_t raw) noexcept {
  double number = 0.0;
  switch (layout.coding) {
    case Coding::kUnsigned:
      number = static_cast<double>(raw);
      break;
    case Coding::kSigned:
      number = static_cast<double>(signed_of(layout, raw));
      break;
    case Coding::kFloat:
      number = static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(raw)));
      break;
    case Coding::kDouble:
      number = std::bit_cast<double>(raw);
      break;
  }
  return number * layout.factor + layout.offset;
}

}  // namespace imuscope::dbc
