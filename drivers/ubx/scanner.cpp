#include "drivers/ubx/scanner.h"

#include "drivers/device/bytes.h"
#include "drivers/nmea/scanner.h"

namespace imuscope::ubx {
namespace {

enum class Verdict : std::uint8_t {
  kNeedMore,
  kMessage,
  kNmea,
  kSeparator,
  kFalseStart,
  kBadChecksum,
  kBadLength
};

struct Examined {
  Verdict verdict;
  std::size_t size = 0;
};

/// 8-bit Fletcher over class, id, length and payload.
bool checksum_is_right(std::span<const std::uint8_t> frame) noexcept {
  std::uint8_t a = 0;
  std::uint8_t b = 0;
  for (const std::uint8_t byte : frame.subspan(2, frame.size() - 2 - kChecksumSize)) {
    a = static_cast<std::uint8_t>(a + byte);
    b = static_cast<std::uint8_t>(b + a);
  }
  return a == frame[frame.size() - 2] && b == frame[frame.size() - 1];
}

Examined examine_message(std::span<const std::uint8_t> pending) noexcept {
  if (pending.size() < 2) return {Verdict::kNeedMore};
  if (pending[1] != kSync2) return {Verdict::kFalseStart};
  if (pending.size() < kHeaderSize) return {Verdict::kNeedMore};
  const std::size_t payload = read_le<std::uint16_t>(pending, 4);
  if (payload > kPayloadMax) return {Verdict::kBadLength};
  const std::size_t size = kHeaderSize + payload + kChecksumSize;
  if (pending.size() < size) return {Verdict::kNeedMore};
  return {checksum_is_right(pending.first(size)) ? Verdict::kMessage : Verdict::kBadChecksum, size};
}

Examined examine_nmea(std::span<const std::uint8_t> pending) noexcept {
  const nmea::Examined found = nmea::examine_sentence(pending);
  switch (found.verdict) {
    case nmea::Verdict::kNeedMore:
      return {Verdict::kNeedMore};
    case nmea::Verdict::kSentence:
      return {Verdict::kNmea, found.size};
    case nmea::Verdict::kBadChecksum:
      return {Verdict::kBadChecksum};
    case nmea::Verdict::kFalseStart:
      break;
  }
  return {Verdict::kFalseStart};
}

Examined examine(std::span<const std::uint8_t> pending) noexcept {
  switch (pending[0]) {
    case kSync1:
      return examine_message(pending);
    case '$':
    case '!':
      return examine_nmea(pending);
    case '\r':
    case '\n':
      return {Verdict::kSeparator};
    default:
      return {Verdict::kFalseStart};
  }
}

}  // namespace

bool Scanner::next(Frame& frame, bool at_end) noexcept {
  buffer_.consume(taken_);
  taken_ = 0;
  for (;;) {
    const auto pending = buffer_.pending();
    if (pending.empty()) return false;
    const Examined found = examine(pending);
    switch (found.verdict) {
      case Verdict::kMessage:
      case Verdict::kNmea: {
        frame = Frame{};
        frame.bytes = pending.first(found.size);
        frame.offset = buffer_.position();
        frame.first_byte = buffer_.arrival_of(0);
        if (found.verdict == Verdict::kMessage) {
          frame.message_class = pending[2];
          frame.id = pending[3];
          frame.payload = frame.bytes.subspan(kHeaderSize, found.size - kHeaderSize - kChecksumSize);
        } else {
          frame.kind = Frame::Kind::kNmea;
        }
        taken_ = found.size;
        return true;
      }
      case Verdict::kSeparator:
        buffer_.consume(1);
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

}  // namespace imuscope::ubx
