#include "drivers/ubx/scanner.h"

#include "base/bytes.h"
#include "drivers/nmea/scanner.h"

namespace imuscope::ubx {
namespace {

constexpr auto kMessageKind = static_cast<std::uint8_t>(Frame::Kind::kMessage);
constexpr auto kNmeaKind = static_cast<std::uint8_t>(Frame::Kind::kNmea);

/// 8-bit Fletcher over class, id, length and payload. The first sum counts every byte once, the second one as
/// often as there are bytes from it to the end; the sums are only taken modulo 256 at the end.
bool checksum_is_right(std::span<const std::uint8_t> frame) noexcept {
  constexpr std::size_t kAtOnce = 4;
  const auto summed = frame.subspan(2, frame.size() - 2 - kChecksumSize);
  std::uint32_t a = 0;
  std::uint32_t b = 0;
  std::size_t i = 0;
  for (; i + kAtOnce <= summed.size(); i += kAtOnce) {
    const std::uint32_t w = summed[i], x = summed[i + 1], y = summed[i + 2], z = summed[i + 3];
    b += 4 * a + 4 * w + 3 * x + 2 * y + z;
    a += w + x + y + z;
  }
  for (; i < summed.size(); ++i) {
    a += summed[i];
    b += a;
  }
  return (a & 0xFFU) == frame[frame.size() - 2] && (b & 0xFFU) == frame[frame.size() - 1];
}

Examined examine_message(std::span<const std::uint8_t> pending) noexcept {
  if (pending.size() < 2) return {Verdict::kNeedMore};
  if (pending[1] != kSync2) return {Verdict::kFalseStart};
  if (pending.size() < kHeaderSize) return {Verdict::kNeedMore};
  const std::size_t payload = read_le<std::uint16_t>(pending, 4);
  if (payload > kPayloadMax) return {Verdict::kBadLength};
  const std::size_t size = kHeaderSize + payload + kChecksumSize;
  if (pending.size() < size) return {Verdict::kNeedMore};
  return {checksum_is_right(pending.first(size)) ? Verdict::kFrame : Verdict::kBadChecksum, size,
          kMessageKind};
}

Examined with_kind(Examined found, std::uint8_t kind) noexcept {
  found.kind = kind;
  return found;
}

Examined examine(std::span<const std::uint8_t> pending) noexcept {
  switch (pending[0]) {
    case kSync1:
      return examine_message(pending);
    case '$':
    case '!':
      return with_kind(nmea::examine_sentence(pending), kNmeaKind);
    case '\r':
    case '\n':
      return {Verdict::kSeparator};
    default:
      return {Verdict::kFalseStart};
  }
}

}  // namespace

bool Scanner::next(Frame& frame, bool at_end) noexcept {
  const auto found = loop_.next(examine, at_end);
  if (!found) return false;
  frame = Frame{};
  frame.kind = static_cast<Frame::Kind>(found->kind);
  frame.bytes = loop_.bytes();
  frame.offset = loop_.position();
  frame.first_byte = loop_.first_byte();
  if (frame.kind == Frame::Kind::kMessage) {
    frame.message_class = frame.bytes[2];
    frame.id = frame.bytes[3];
    frame.payload = frame.bytes.subspan(kHeaderSize, found->size - kHeaderSize - kChecksumSize);
  }
  return true;
}

}  // namespace imuscope::ubx
