#include "drivers/ixblue_stdbin/messages.h"

#include <bit>
#include <cstring>

#include "base/bytes.h"

namespace imuscope::ixblue_stdbin {
namespace {

/// Places the blocks of one mask from `at` on. False where a bit or the size ends the walk.
template <std::size_t N>
bool place_blocks(std::uint32_t mask, const BlockLayout (&layouts)[N], std::array<std::uint16_t, N>& offsets,
                  std::size_t end, std::size_t& at) noexcept {
  for (; mask != 0; mask &= mask - 1) {
    const auto bit = static_cast<std::size_t>(std::countr_zero(mask));
    if (bit >= N || layouts[bit].size == 0 || at + layouts[bit].size > end) return false;
    offsets[bit] = static_cast<std::uint16_t>(at);
    at += layouts[bit].size;
  }
  return true;
}

std::string_view text_of(std::span<const std::uint8_t> bytes) noexcept {
  const auto* begin = reinterpret_cast<const char*>(bytes.data());
  const void* zero = std::memchr(begin, 0, bytes.size());
  const std::size_t size =
      zero == nullptr ? bytes.size() : static_cast<std::size_t>(static_cast<const char*>(zero) - begin);
  return {begin, size};
}

}  // namespace

std::span<const std::uint8_t> Telegram::block(Nav block) const noexcept {
  const auto i = static_cast<std::size_t>(block);
  if (nav_at[i] == 0) return {};
  return bytes.subspan(nav_at[i], kNavBlocks[i].size);
}

std::span<const std::uint8_t> Telegram::block(Extended block) const noexcept {
  const auto i = static_cast<std::size_t>(block);
  if (extended_at[i] == 0) return {};
  return bytes.subspan(extended_at[i], kExtendedBlocks[i].size);
}

Telegram parse_telegram(std::span<const std::uint8_t> frame) noexcept {
  Telegram telegram;
  telegram.bytes = frame;
  telegram.version = frame[kVersionOffset];
  const HeaderLayout& header = header_layout(telegram.version);
  telegram.nav_mask = read_be<std::uint32_t>(frame, header.nav_mask);
  if (header.extended_mask != 0) telegram.extended_mask = read_be<std::uint32_t>(frame, header.extended_mask);
  telegram.external_mask = read_be<std::uint32_t>(frame, header.external_mask);
  if (header.nav_size != 0) telegram.nav_size = read_be<std::uint16_t>(frame, header.nav_size);
  telegram.total_size = read_be<std::uint16_t>(frame, header.total_size);
  telegram.validity_ticks = read_be<std::uint32_t>(frame, header.validity);
  telegram.counter = read_be<std::uint32_t>(frame, header.counter);
  telegram.checksum = read_be<std::uint32_t>(frame, frame.size() - kChecksumSize);

  const std::size_t end = frame.size() - kChecksumSize;
  std::size_t at = header.size;
  bool known = place_blocks(telegram.nav_mask, kNavBlocks, telegram.nav_at, end, at) &&
               place_blocks(telegram.extended_mask, kExtendedBlocks, telegram.extended_at, end, at);
  telegram.rest_unread = !known;
  // From V4 on the header says where the external blocks begin, whatever stands before them.
  if (telegram.nav_size) {
    at = header.size + *telegram.nav_size;
    known = at <= end;
  }
  if (!known || !place_blocks(telegram.external_mask, kExternalBlocks, telegram.external_at, end, at)) {
    telegram.rest_unread = true;
  }
  return telegram;
}

FieldValue read_field(FieldType type, std::span<const std::uint8_t> block_bytes,
                      std::size_t offset) noexcept {
  const auto number = [&](auto sample_of_type) {
    return FieldValue{type, static_cast<double>(read_be<decltype(sample_of_type)>(block_bytes, offset)), {}};
  };
  switch (type) {
    case FieldType::kU8:
      return number(std::uint8_t{});
    case FieldType::kU16:
      return number(std::uint16_t{});
    case FieldType::kU32:
      return number(std::uint32_t{});
    case FieldType::kI32:
      return number(std::int32_t{});
    case FieldType::kF32:
      return number(float{});
    case FieldType::kF64:
      return number(double{});
    case FieldType::kText8:
    case FieldType::kText32:
      break;
  }
  return {type, 0.0, text_of(block_bytes.subspan(offset, size_of(type)))};
}

}  // namespace imuscope::ixblue_stdbin
