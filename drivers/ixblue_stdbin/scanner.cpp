#include "drivers/ixblue_stdbin/scanner.h"

#include <algorithm>
#include <bit>

#include "drivers/device/bytes.h"

namespace imuscope::ixblue_stdbin {
namespace {

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

}  // namespace

bool Scanner::next(Frame& frame, bool at_end) noexcept {
  buffer_.consume(taken_);
  taken_ = 0;
  for (;;) {
    const auto searched = buffer_.pending();
    const auto* start =
        std::find_if(searched.data(), searched.data() + searched.size(),
                     [](std::uint8_t byte) { return byte == kTelegramSync[0] || byte == kAnswerSync[0]; });
    skip(static_cast<std::size_t>(start - searched.data()));
    const auto pending = buffer_.pending();
    if (pending.empty()) return false;
    const Examined found = examine(pending);
    switch (found.verdict) {
      case Verdict::kFrame:
        frame = {found.kind, pending.first(found.size), buffer_.position(), buffer_.arrival_of(0)};
        taken_ = found.size;
        return true;
      case Verdict::kNeedMore:
        if (!at_end) return false;
        break;
      case Verdict::kBadChecksum:
        ++counters_.bad_checksums;
        break;
      case Verdict::kBadLength:
        ++counters_.bad_lengths;
        break;
      case Verdict::kFalseStart:
        break;
    }
    skip(1);
  }
}

void Scanner::skip(std::size_t n) noexcept {
  counters_.bytes_skipped += n;
  buffer_.consume(n);
}

Scanner::Examined Scanner::examine(std::span<const std::uint8_t> pending) noexcept {
  const bool telegram = pending[0] == kTelegramSync[0];
  if (pending.size() < 2) return {Verdict::kNeedMore};
  if (pending[1] != (telegram ? kTelegramSync[1] : kAnswerSync[1])) return {Verdict::kFalseStart};
  if (pending.size() <= kVersionOffset) return {Verdict::kNeedMore};
  return telegram ? examine_telegram(pending) : examine_answer(pending);
}

Scanner::Examined Scanner::examine_telegram(std::span<const std::uint8_t> pending) noexcept {
  const std::uint8_t version = pending[kVersionOffset];
  if (version == kVersionMax + 1) ++counters_.unsupported_versions;
  if (version < kVersionMin || version > kVersionMax) return {Verdict::kFalseStart};
  const HeaderLayout& header = header_layout(version);
  if (pending.size() < header.size) return {Verdict::kNeedMore};
  const std::size_t total = read_be<std::uint16_t>(pending, header.total_size);
  if (total > kTelegramMax || !sizes_are_possible(pending, header, total)) return {Verdict::kBadLength};
  if (pending.size() < total) return {Verdict::kNeedMore};
  const std::size_t summed = total - kChecksumSize;
  if (sum_of_bytes(pending.first(summed)) != read_be<std::uint32_t>(pending, summed)) {
    return {Verdict::kBadChecksum};
  }
  return {Verdict::kFrame, total, Frame::Kind::kTelegram};
}

Scanner::Examined Scanner::examine_answer(std::span<const std::uint8_t> pending) noexcept {
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
  return {Verdict::kFrame, total, Frame::Kind::kAnswer};
}

}  // namespace imuscope::ixblue_stdbin
