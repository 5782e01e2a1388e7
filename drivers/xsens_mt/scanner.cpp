#include "drivers/xsens_mt/scanner.h"

#include <algorithm>
#include <cstring>

#include "base/bytes.h"

namespace imuscope::xsens {

bool Scanner::next(Frame& frame, bool at_end) noexcept {
  if (nested_at_ < taken_ && next_nested(frame)) return true;
  for (;;) {
    const auto behind = buffer_.pending().subspan(taken_);
    if (behind.empty()) return false;
    const Examined found = examine(behind);
    if (found.verdict == Verdict::kFrame) {
      buffer_.consume(taken_);
      taken_ = found.size;
      in_step_ = true;
      nested_at_ = 1;
      fill(frame, 0, found);
      return true;
    }
    if (found.verdict == Verdict::kNeedMore && !at_end) return false;
    if (taken_ > 0) {
      const Verdict inside = look_back(at_end);
      if (inside == Verdict::kNeedMore) return false;
      if (inside == Verdict::kFrame) continue;
    }
    count(found.verdict);
    buffer_.consume(taken_ + 1);
    taken_ = 0;
    nested_at_ = 0;
    counters_.bytes_skipped += 1;
    // Whatever is no preamble goes at once.
    const auto rest = buffer_.pending();
    const auto preamble = std::find(rest.begin(), rest.end(), kPreamble);
    const auto n = static_cast<std::size_t>(preamble - rest.begin());
    counters_.bytes_skipped += n;
    buffer_.consume(n);
  }
}

void Scanner::fill(Frame& frame, std::size_t start, const Examined& found) const noexcept {
  const auto bytes = buffer_.pending().subspan(start, found.size);
  frame.bid = bytes[1];
  frame.mid = bytes[2];
  frame.data = bytes.subspan(found.header, found.size - found.header - kChecksumSize);
  frame.size = found.size;
  frame.offset = buffer_.position() + start;
  frame.first_byte = buffer_.arrival_of(start);
  frame.nested = start > 0;
}

// Frames that lie whole inside the one taken last.
bool Scanner::next_nested(Frame& frame) noexcept {
  const auto inside = buffer_.pending().first(taken_);
  while (nested_at_ < taken_) {
    const void* preamble = std::memchr(inside.data() + nested_at_, kPreamble, taken_ - nested_at_);
    if (preamble == nullptr) break;
    const auto start = static_cast<std::size_t>(static_cast<const std::uint8_t*>(preamble) - inside.data());
    nested_at_ = start + 1;
    // Most preambles in data are none, and say so in their next bytes.
    if (start + kHeaderSize + kChecksumSize > taken_) break;
    const std::uint8_t bid = inside[start + 1];
    const std::size_t length = inside[start + 3];
    const bool fits = length == kExtendedLength || start + kHeaderSize + length + kChecksumSize <= taken_;
    if ((bid > kBusBidMax && bid != kMasterBid) || !fits) continue;
    if (const Examined found = examine(inside.subspan(start)); found.verdict == Verdict::kFrame) {
      fill(frame, start, found);
      return true;
    }
  }
  nested_at_ = taken_;
  return false;
}

Scanner::Examined Scanner::examine(std::span<const std::uint8_t> bytes) noexcept {
  if (bytes[0] != kPreamble) return {Verdict::kFalseStart};
  if (bytes.size() < 2) return {Verdict::kNeedMore};
  if (bytes[1] > kBusBidMax && bytes[1] != kMasterBid) return {Verdict::kFalseStart};
  if (bytes.size() < kHeaderSize) return {Verdict::kNeedMore};
  std::size_t header = kHeaderSize;
  std::size_t length = bytes[3];
  if (length == kExtendedLength) {
    if (bytes.size() < kExtendedHeaderSize) return {Verdict::kNeedMore};
    header = kExtendedHeaderSize;
    length = read_be<std::uint16_t>(bytes, kHeaderSize);
    if (length > kDataMax) return {Verdict::kBadLength};
  }
  const std::size_t size = header + length + kChecksumSize;
  if (bytes.size() < size) return {Verdict::kNeedMore};
  if ((sum_of_bytes(bytes.subspan(1, size - 1)) & 0xFFU) != 0) return {Verdict::kBadChecksum};
  return {Verdict::kFrame, header, size};
}

// After the last frame comes no frame, so it may have been a false one that swallowed the start of a good
// one. Where there is such a good one, drops what is before it and says kFrame.
Scanner::Verdict Scanner::look_back(bool at_end) noexcept {
  const auto bytes = buffer_.pending();
  for (std::size_t start = 1; start < taken_; ++start) {
    if (bytes[start] != kPreamble) continue;
    const Examined found = examine(bytes.subspan(start));
    if (found.verdict == Verdict::kNeedMore && !at_end) return found.verdict;
    if (found.verdict != Verdict::kFrame || start + found.size <= taken_) continue;
    buffer_.consume(start);
    taken_ = 0;
    nested_at_ = 0;
    return found.verdict;
  }
  return Verdict::kFalseStart;
}

void Scanner::count(Verdict verdict) noexcept {
  if (!in_step_) return;
  if (verdict == Verdict::kBadChecksum) ++counters_.bad_checksums;
  if (verdict == Verdict::kBadLength) ++counters_.bad_lengths;
}

}  // namespace imuscope::xsens
