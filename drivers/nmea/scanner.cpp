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
  if (is_line_end(pending[i]) && !checksum_required) return {Verdict::kSentence, i};
  if (pending[i] != '*' || i <= kAddressMin) return {Verdict::kFalseStart};
  constexpr std::size_t kDigits = 2;
  for (std::size_t digit = 1; digit <= kDigits; ++digit) {
    if (i + digit >= pending.size()) return {Verdict::kNeedMore};
    if (hex_value(pending[i + digit]) < 0) return {Verdict::kFalseStart};
  }
  const bool right = 16 * hex_value(pending[i + 1]) + hex_value(pending[i + 2]) == sum;
  return {right ? Verdict::kSentence : Verdict::kBadChecksum, i + 1 + kDigits};
}

bool Scanner::next(Frame& frame, bool at_end) noexcept {
  buffer_.consume(taken_);
  taken_ = 0;
  for (;;) {
    const auto pending = buffer_.pending();
    if (pending.empty()) return false;
    if (is_start(pending[0])) {
      const Examined found = examine_sentence(pending, checksum_required_);
      if (found.verdict == Verdict::kSentence) {
        frame = {{reinterpret_cast<const char*>(pending.data()), found.size},
                 buffer_.position(),
                 buffer_.arrival_of(0)};
        taken_ = found.size;
        return true;
      }
      if (found.verdict == Verdict::kNeedMore && !at_end) return false;
      if (found.verdict == Verdict::kBadChecksum) ++counters_.bad_checksums;
    }
    // The end of the line belongs to the sentence before it.
    if (!is_line_end(pending[0])) ++counters_.bytes_skipped;
    buffer_.consume(1);
  }
}

}  // namespace imuscope::nmea
