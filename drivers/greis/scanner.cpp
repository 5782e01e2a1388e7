#include "drivers/greis/scanner.h"

#include <algorithm>
#include <bit>

#include "base/bytes.h"

namespace imuscope::greis {
namespace {

constexpr auto kMessageKind = static_cast<std::uint8_t>(Frame::Kind::kMessage);
constexpr auto kTextKind = static_cast<std::uint8_t>(Frame::Kind::kText);

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
    if (is_line_end(pending[i])) return {Verdict::kFrame, i, kTextKind};
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

bool crc_is_right(std::span<const std::uint8_t> message) noexcept {
  if (message.size() < kHeaderSize + kCrcSize) return false;
  const std::size_t summed = message.size() - kCrcSize;
  return crc16(message.first(summed)) == read_le<std::uint16_t>(message, summed);
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
  const bool crc = id == kReferenceEpoch || id == kReferenceMeasurements || id == kReferenceVelocity;
  const bool no_checksum = id == kFileIdentifier || id == kReply || id == kErrorReply;
  const bool hex_checksum = id == kMessagesFormat || id == kParameter;
  // Text that is none shows a damaged id or length before all announced bytes have come.
  if ((no_checksum || hex_checksum) && !std::all_of(seen.begin(), seen.end(), is_text)) {
    return {Verdict::kFalseStart};
  }
  if (pending.size() < size) return {Verdict::kNeedMore};
  const bool right = no_checksum || (hex_checksum ? hex_checksum_is_right(seen)
                                     : crc        ? crc_is_right(seen)
                                                  : checksum(seen.first(size - 1)) == seen.back());
  return {right ? Verdict::kFrame : Verdict::kBadChecksum, size, kMessageKind};
}

Examined examine(std::span<const std::uint8_t> pending) noexcept {
  const std::uint8_t first = pending[0];
  if (is_line_end(first)) return {Verdict::kSeparator};
  if (first >= kTextMin && first <= kTextMax) return examine_text(pending);
  if (is_id(first)) return examine_message(pending);
  return {Verdict::kFalseStart};
}

}  // namespace

std::uint8_t checksum(std::span<const std::uint8_t> bytes) noexcept {
  // Four turns by two bits are a whole one, so that bytes four apart meet in the same place: they are first
  // brought together eight at a time, and turned once at the end.
  constexpr std::size_t kWord = sizeof(std::uint64_t);
  constexpr std::size_t kTurn = 4;
  std::uint64_t words = 0;
  const std::size_t in_words = bytes.size() / kWord * kWord;
  for (std::size_t at = 0; at < in_words; at += kWord) words ^= read_le<std::uint64_t>(bytes, at);
  std::uint8_t sum = 0;
  for (std::size_t i = 0; i < kTurn; ++i) {
    const auto both = static_cast<std::uint8_t>(words >> (8 * i) ^ words >> (8 * (i + kTurn)));
    sum = static_cast<std::uint8_t>(std::rotl(sum, 2) ^ both);
  }
  for (const std::uint8_t byte : bytes.subspan(in_words)) {
    sum = static_cast<std::uint8_t>(std::rotl(sum, 2) ^ byte);
  }
  return std::rotl(sum, 2);
}

std::uint16_t crc16(std::span<const std::uint8_t> bytes) noexcept {
  constexpr unsigned kPolynomial = 0x1021;
  unsigned crc = 0;
  for (const std::uint8_t byte : bytes) {
    crc ^= static_cast<unsigned>(byte) << 8U;
    for (int bit = 0; bit < 8; ++bit) crc = (crc & 0x8000U) != 0 ? crc << 1U ^ kPolynomial : crc << 1U;
  }
  return static_cast<std::uint16_t>(crc);
}

bool Scanner::next(Frame& frame, bool at_end) noexcept {
  const auto found = loop_.next(examine, at_end);
  if (!found) return false;
  frame = {static_cast<Frame::Kind>(found->kind), 0, loop_.bytes(), {}, loop_.position(), loop_.first_byte()};
  if (frame.kind == Frame::Kind::kMessage) {
    frame.id = id_of(static_cast<char>(frame.bytes[0]), static_cast<char>(frame.bytes[1]));
    frame.body = frame.bytes.subspan(kHeaderSize);
  }
  return true;
}

}  // namespace imuscope::greis
