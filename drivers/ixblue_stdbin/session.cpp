#include "drivers/ixblue_stdbin/session.h"

namespace imuscope::ixblue_stdbin {
namespace {

/// Without a good telegram for this long something is wrong: the slowest usual output is 1 Hz.
constexpr Duration kSilence = std::chrono::seconds(3);

constexpr std::string_view kNoBytes =
    "no data from the unit: check cable and port, and that the unit's output is switched on";
constexpr std::string_view kWrongVersion =
    "the unit sends StdBin V6, which is not read: set its output protocol to STDBIN V5 or lower";
constexpr std::string_view kNoTelegram =
    "bytes arrive but no StdBin telegram: check the baud rate, and that the unit's output protocol is STDBIN "
    "V2 "
    "to V5";

}  // namespace

void Session::on_bytes(std::span<const std::uint8_t> bytes, HostTime now) noexcept {
  if (!started_) {
    started_ = true;
    last_good_ = now;
  }
  bytes_since_good_ += bytes.size();
  Frame frame;
  while (!bytes.empty()) {
    bytes = bytes.subspan(scanner_.append(bytes, now));
    while (scanner_.next(frame)) {
      if (frame.kind != Frame::Kind::kTelegram) continue;
      state_ = SessionState::kStreaming;
      problem_ = {};
      last_good_ = now;
      bytes_since_good_ = 0;
    }
  }
}

std::span<const std::uint8_t> Session::poll(HostTime now) noexcept {
  if (!started_) {
    started_ = true;
    last_good_ = now;
  }
  if (now - last_good_ > kSilence) {
    state_ = SessionState::kFailed;
    problem_ = bytes_since_good_ == 0                         ? kNoBytes
               : scanner_.counters().unsupported_versions > 0 ? kWrongVersion
                                                              : kNoTelegram;
  }
  return {};
}

}  // namespace imuscope::ixblue_stdbin
