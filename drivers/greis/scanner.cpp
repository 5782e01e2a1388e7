#include "drivers/greis/scanner.h"

#include <algorithm>
#include <bit>

namespace imuscope::greis {
namespace {

enum class Verdict : std::uint8_t { kNeedMore, kFrame, kSeparator, kFalseStart, kBadChecksum, kBadLength };

struct Examined {
  Verdict verdict;
  std::size_t size = 0;
  Frame::Kind kind = Frame::Kind::kMessage;
};

constexpr bool is_line_end(std::uint8_t byte) noexcept { return byte == '\r' || byte == '\n'; }
constexpr bool is_printable(std::uint8_t byte) noexcept { return byte >= ' ' && byte <= '~'; }
constexpr bool is_text(std::uint8_t byte) noexcept {
  return is_printable(byte) || is_line_end(byte) || byte == '\t';
}
constexpr bool is_id(std::uint8_t byte) noexcept { return byte >= kIdMin && byte <= kIdMax; }

/// Value of an upper-case hex digit, -1 for anything else.
constexpr int hex_value(std::uint8_t byte) noexcept {
  if (byte >= '0' && byte <= '9') return byte - '0';
  if (byte >= 'A' && byte <= 'F') return byte - 'A' + 10;
  return -1;
}

Examined examine_text(std::span<const std::uint8_t> pending) noexcept {
  const std::size_t searched = std::min(pending.size(), kTextLineMax);
  for (std::size_t i = 1; i < searched; ++i) {
    if (is_line_end(pending[i])) return {Verdict::kFrame, i, Frame::Kind::kText};
    if (!is_printable(pending[i])) return {Verdict::kFalseStart};
  }
  return {searched == kTextLineMax ? Verdict::kFalseStart : Verdict::kNeedMore};
}

bool hex_checksum_is_right(std::span<const std::uint8_t> message) noexcept {
  if (message.size() < kHeaderSize + 2) return false;
  const int high = hex_value(message[message.size() - 2]);
  const int low = hex_value(message[message.size() - 1]);
  return high >= 0 && low >= 0 && checksum(message.first(message.size() - 2)) == 16 * high + low;
}

Examined examine_message(std::span<const std::uint8_t> pending) noexcept {
  if (pending.size() < kIdSize) return {Verdict::kNeedMore};
  if (!is_id(pending[1])) return {Verdict::kFalseStart};
  std::size_t body_size = 0;
  for (std::size_t i = kIdSize; i < kHeaderSize; ++i) {
    if (i >= pending.size()) return {Verdict::kNeedMore};
    const int digit = hex_value(pending[i]);
    if (digit < 0) return {Verdict::kFalseStart};
    body_size = 16 * body_size + static_cast<std::size_t>(digit);
  }
  const std::uint16_t id = id_of(static_cast<char>(pending[0]), static_cast<char>(pending[1]));
  const std::size_t shortest = body_min(id);
  const bool possible =
      body_size > 0 && (shortest == 0 || (body_size >= shortest && body_size <= shortest + kBodyGrowthMax));
  if (!possible) return {Verdict::kBadLength};

  const std::size_t size = kHeaderSize + body_size;
  const auto seen = pending.first(std::min(size, pending.size()));
  const bool no_checksum = id == kFileIdentifier || id == kReply || id == kErrorReply;
  const bool hex_checksum = id == kMessagesFormat || id == kParameter;
  // Text that is none shows a damaged id or length before all announced bytes have come.
  if ((no_checksum || hex_checksum) && !std::all_of(seen.begin(), seen.end(), is_text)) {
    return {Verdict::kFalseStart};
  }
  if (pending.size() < size) return {Verdict::kNeedMore};
  const bool right = no_checksum || (hex_checksum ? hex_checksum_is_right(seen)
                                                  : checksum(seen.first(size - 1)) == seen.back());
  return {right ? Verdict::kFrame : Verdict::kBadChecksum, size};
}

Examined examine(std::span<const std::uint8_t> pending) noexcept {
  const std::uint8_t first = pending[0];
  if (is_line_end(first)) return {Verdict::kSeparator, 1};
  if (first >= kTextMin && first <= kTextMax) return examine_text(pending);
  if (is_id(first)) return examine_message(pending);
  return {Verdict::kFalseStart};
}

}  // namespace

std::uint8_t checksum(std::span<const std::uint8_t> bytes) noexcept {
  std::uint8_t sum = 0;
  for (const std::uint8_t byte : bytes) sum = static_cast<std::uint8_t>(std::rotl(sum, 2) ^ byte);
  return std::rotl(sum, 2);
}

bool Scanner::next(Frame& frame, bool at_end) noexcept {
  buffer_.consume(taken_);
  taken_ = 0;
  for (;;) {
    const auto pending = buffer_.pending();
    if (pending.empty()) return false;
    const Examined found = examine(pending);
    switch (found.verdict) {
      case Verdict::kFrame: {
        frame = {found.kind, 0, pending.first(found.size), {}, buffer_.position(), buffer_.arrival_of(0)};
        if (found.kind == Frame::Kind::kMessage) {
          frame.id = id_of(static_cast<char>(pending[0]), static_cast<char>(pending[1]));
          frame.body = frame.bytes.subspan(kHeaderSize);
        }
        taken_ = found.size;
        return true;
      }
      case Verdict::kSeparator:
        buffer_.consume(found.size);
        continue;
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
    ++counters_.bytes_skipped;
    buffer_.consume(1);
  }
}

}  // namespace imuscope::greis
