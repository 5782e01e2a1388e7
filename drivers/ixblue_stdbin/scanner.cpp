#include "drivers/ixblue_stdbin/scanner.h"

#include <algorithm>
#include <bit>

#include "base/bytes.h"

namespace imuscope::ixblue_stdbin {
namespace {

constexpr auto kTelegramKind = static_cast<std::uint8_t>(Frame::Kind::kTelegram);
constexpr auto kAnswerKind = static_cast<std::uint8_t>(Frame::Kind::kAnswer);

struct MaskSize {
  std::size_t bytes = 0;
  bool all_known = true;
};

MaskSize size_of_blocks(std::uint32_t mask, std::span<const BlockLayout> layouts) noexcept {
  MaskSize size;
  for (; mask != 0; mask &= mask - 1) {
    const auto bit = static_cast<std::size_t>(std::countr_zero(mask));
    if (bit < layouts.size() && layouts[bit].size != 0) {
      size.bytes += layouts[bit].size;
    } else {
      size.all_known = false;
    }
  }
  return size;
}

/// Whether the masks and the sizes of a complete header can belong together. A header that contradicts itself
/// is refused at once, instead of after the bytes that it announces.
bool sizes_are_possible(std::span<const std::uint8_t> header_bytes, const HeaderLayout& header,
                        std::size_t total) noexcept {
  const MaskSize nav = size_of_blocks(read_be<std::uint32_t>(header_bytes, header.nav_mask), kNavBlocks);
  MaskSize extended;
  if (header.extended_mask != 0) {
    extended = size_of_blocks(read_be<std::uint32_t>(header_bytes, header.extended_mask), kExtendedBlocks);
  }
  const MaskSize external =
      size_of_blocks(read_be<std::uint32_t>(header_bytes, header.external_mask), kExternalBlocks);
  const bool inside_known = nav.all_known && extended.all_known;
  const std::size_t inside = nav.bytes + extended.bytes;
  if (header.nav_size != 0) {
    const std::size_t announced = read_be<std::uint16_t>(header_bytes, header.nav_size);
    if (inside_known ? announced != inside : announced < inside) return false;
  }
  const std::size_t known = header.size + inside + external.bytes + kChecksumSize;
  return inside_known && external.all_known ? total == known : total >= known;
}

Examined examine_answer(std::span<const std::uint8_t> pending) noexcept {
  const std::uint8_t version = pending[kVersionOffset];
  if (version < kAnswerVersionMin || version > kVersionMax) return {Verdict::kFalseStart};
  if (pending.size() < kAnswerHeaderSize) return {Verdict::kNeedMore};
  const std::size_t total = read_be<std::uint16_t>(pending, kAnswerSizeOffset);
  if (total < kAnswerHeaderSize + kChecksumSize || total > kAnswerMax) return {Verdict::kBadLength};
  if (pending.size() < total) return {Verdict::kNeedMore};
  const std::size_t summed = total - kChecksumSize;
  if (sum_of_bytes(pending.first(summed)) != read_be<std::uint32_t>(pending, summed)) {
    return {Verdict::kBadChecksum};
  }
  return {Verdict::kFrame, total, kAnswerKind};
}

}  // namespace

bool Scanner::next(Frame& frame, bool at_end) noexcept {
  const auto found =
      loop_.next([this](std::span<const std::uint8_t> pending) noexcept { return examine(pending); }, at_end);
  if (!found) return false;
  frame = {static_cast<Frame::Kind>(found->kind), loop_.bytes(), loop_.position(), loop_.first_byte()};
  return true;
}

Examined Scanner::examine(std::span<const std::uint8_t> pending) noexcept {
  const bool telegram = pending[0] == kTelegramSync[0];
  if (!telegram && pending[0] != kAnswerSync[0]) return {Verdict::kFalseStart};
  if (pending.size() < 2) return {Verdict::kNeedMore};
  if (pending[1] != (telegram ? kTelegramSync[1] : kAnswerSync[1])) return {Verdict::kFalseStart};
  if (pending.size() <= kVersionOffset) return {Verdict::kNeedMore};
  return telegram ? examine_telegram(pending) : examine_answer(pending);
}

Examined Scanner::examine_telegram(std::span<const std::uint8_t> pending) noexcept {
  const std::uint8_t version = pending[kVersionOffset];
  if (version == kVersionMax + 1) ++unsupported_versions_;
  if (version < kVersionMin || version > kVersionMax) return {Verdict::kFalseStart};
  const HeaderLayout& header = header_layout(version);
  if (pending.size() < header.size) return {Verdict::kNeedMore};
  const std::size_t total = read_be<std::uint16_t>(pending, header.total_size);
  const std::size_t sizes_end = header.total_size + sizeof(std::uint16_t);
  const bool as_before = std::equal(pending.begin(), pending.begin() + static_cast<std::ptrdiff_t>(sizes_end),
                                    possible_.begin());
  if (!as_before && (total > kTelegramMax || !sizes_are_possible(pending, header, total))) {
    return {Verdict::kBadLength};
  }
  if (pending.size() < total) return {Verdict::kNeedMore};
  const std::size_t summed = total - kChecksumSize;
  if (sum_of_bytes(pending.first(summed)) != read_be<std::uint32_t>(pending, summed)) {
    return {Verdict::kBadChecksum};
  }
  if (!as_before) std::copy_n(pending.begin(), sizes_end, possible_.begin());
  return {Verdict::kFrame, total, kTelegramKind};
}

}  // namespace imuscope::ixblue_stdbin
