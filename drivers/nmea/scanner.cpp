#include "drivers/nmea/scanner.h"

#include <algorithm>
#include <array>

namespace imuscope::nmea {
namespace {

constexpr bool is_start(std::uint8_t byte) noexcept { return byte == '$' || byte == '!'; }
constexpr bool is_line_end(std::uint8_t byte) noexcept { return byte == '\r' || byte == '\n'; }
constexpr bool is_printable(std::uint8_t byte) noexcept { return byte >= ' ' && byte <= '~'; }

/// What may stand between the start and '*': printable characters that neither start nor end a sentence.
constexpr auto kIsContent = [] {
  std::array<bool, 256> table{};
  for (unsigned byte = 0; byte < table.size(); ++byte) {
    const auto b = static_cast<std::uint8_t>(byte);
    table[byte] = is_printable(b) && !is_start(b) && b != '*';
  }
  return table;
}();

/// Shortest address: 'P' and three letters of a maker.
constexpr std::size_t kAddressMin = 4;

/// Value of a hex digit of either case, -1 for anything else.
constexpr int hex_value(std::uint8_t byte) noexcept {
  if (byte >= '0' && byte <= '9') return byte - '0';
  if (byte >= 'A' && byte <= 'F') return byte - 'A' + 10;
  if (byte >= 'a' && byte <= 'f') return byte - 'a' + 10;
  return -1;
}

}  // namespace

Examined examine_sentence(std::span<const std::uint8_t> pending, bool checksum_required) noexcept {
  const std::size_t searched = std::min(pending.size(), kSentenceMax);
  std::uint8_t sum = 0;
  std::size_t i = 1;
  for (; i < searched && kIsContent[pending[i]]; ++i) sum = static_cast<std::uint8_t>(sum ^ pending[i]);
  if (i == searched) return {searched == kSentenceMax ? Verdict::kFalseStart : Verdict::kNeedMore};
  if (is_line_end(pending[i]) && !checksum_required) return {Verdict::kFrame, i};
  if (pending[i] != '*' || i <= kAddressMin) return {Verdict::kFalseStart};
  constexpr std::size_t kDigits = 2;
  for (std::size_t digit = 1; digit <= kDigits; ++digit) {
    if (i + digit >= pending.size()) return {Verdict::kNeedMore};
    if (hex_value(pending[i + digit]) < 0) return {Verdict::kFalseStart};
  }
  const bool right = 16 * hex_value(pending[i + 1]) + hex_value(pending[i + 2]) == sum;
  return {right ? Verdict::kFrame : Verdict::kBadChecksum, i + 1 + kDigits};
}

bool Scanner::next(Frame& frame, bool at_end) noexcept {
  const auto examine = [this](std::span<const std::uint8_t> pending) noexcept -> Examined {
    if (is_start(pending[0])) return examine_sentence(pending, checksum_required_);
    // The end of the line belongs to the sentence before it.
    return {is_line_end(pending[0]) ? Verdict::kSeparator : Verdict::kFalseStart};
  };
  if (!loop_.next(examine, at_end)) return false;
  const auto bytes = loop_.bytes();
  frame = {{reinterpret_cast<const char*>(bytes.data()), bytes.size()}, loop_.position(), loop_.first_byte()};
  return true;
}

}  // namespace imuscope::nmea
