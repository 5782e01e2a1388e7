#include "drivers/throwaway/scanner.h"

#include "base/bytes.h"

namespace imuscope::throwaway {
namespace {

Examined examine(std::span<const std::uint8_t> pending) noexcept {
  if (pending[0] != kSync1) return {Verdict::kFalseStart};
  if (pending.size() < kSyncSize) return {Verdict::kNeedMore};
  if (pending[1] != kSync2) return {Verdict::kFalseStart};
  if (pending.size() < kFrameSize) return {Verdict::kNeedMore};
  const auto sum = sum_of_bytes(pending.subspan(kSyncSize, kChecksumAt - kSyncSize));
  return {static_cast<std::uint8_t>(sum) == pending[kChecksumAt] ? Verdict::kFrame : Verdict::kBadChecksum,
          kFrameSize};
}

}  // namespace

bool Scanner::next(Frame& frame, bool at_end) noexcept {
  if (!loop_.next(examine, at_end)) return false;
  frame = {loop_.bytes(), loop_.first_byte()};
  return true;
}

}  // namespace imuscope::throwaway
