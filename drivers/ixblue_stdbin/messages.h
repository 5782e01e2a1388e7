#pragma once

/// A telegram taken apart: header numbers and the place of each block, all in wire units. Blocks that a
/// telegram does not carry are absent, never stale.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "drivers/ixblue_stdbin/wire.h"

namespace imuscope::ixblue_stdbin {

/// Refers to the frame's bytes; valid as long as they are.
struct Telegram {
  std::uint8_t version = 0;
  std::uint32_t nav_mask = 0;
  std::uint32_t extended_mask = 0;  ///< 0 in V2
  std::uint32_t external_mask = 0;
  std::optional<std::uint16_t> nav_size;  ///< V4 and V5
  std::uint16_t total_size = 0;
  std::uint32_t validity_ticks = 0;  ///< 100 us, time of day
  std::uint32_t counter = 0;
  std::uint32_t checksum = 0;
  /// A mask bit of unknown meaning, or a size that does not fit, left blocks unread.
  bool rest_unread = false;

  std::span<const std::uint8_t> bytes;
  /// Offsets into bytes; 0 = absent.
  std::array<std::uint16_t, std::size(kNavBlocks)> nav_at{};
  std::array<std::uint16_t, std::size(kExtendedBlocks)> extended_at{};
  std::array<std::uint16_t, std::size(kExternalBlocks)> external_at{};

  /// Bytes of a block, empty where the telegram does not carry it.
  [[nodiscard]] std::span<const std::uint8_t> block(Nav block) const noexcept;
  [[nodiscard]] std::span<const std::uint8_t> block(Extended block) const noexcept;

  /// Calls visit(const BlockLayout&, std::span<const std::uint8_t> block_bytes) for every block read, in
  /// stream order.
  template <typename Visit>
  void for_each_block(Visit&& visit) const {
    const auto group = [&](const auto& layouts, const auto& offsets) {
      for (std::size_t i = 0; i < offsets.size(); ++i) {
        if (offsets[i] != 0) visit(layouts[i], bytes.subspan(offsets[i], layouts[i].size));
      }
    };
    group(kNavBlocks, nav_at);
    group(kExtendedBlocks, extended_at);
    group(kExternalBlocks, external_at);
  }
};

/// Takes a telegram apart whose checksum and size have been found right by the scanner.
[[nodiscard]] Telegram parse_telegram(std::span<const std::uint8_t> frame) noexcept;

/// Value of one field. Every integer of the protocol is exact in a double.
struct FieldValue {
  FieldType type;
  double number;          ///< of all but text
  std::string_view text;  ///< of kText8 and kText32, cut at the first zero byte
};

/// @param offset  of the field in the block; for_each_field() runs through them
[[nodiscard]] FieldValue read_field(FieldType type, std::span<const std::uint8_t> block_bytes,
                                    std::size_t offset) noexcept;

/// Calls visit(const FieldLayout&, const FieldValue&) for every field of a block.
template <typename Visit>
void for_each_field(const BlockLayout& layout, std::span<const std::uint8_t> block_bytes, Visit&& visit) {
  std::size_t offset = 0;
  for (const FieldLayout& field : layout.fields) {
    visit(field, read_field(field.type, block_bytes, offset));
    offset += size_of(field.type);
  }
}

}  // namespace imuscope::ixblue_stdbin
