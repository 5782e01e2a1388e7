#include "drivers/ixblue_stdbin/session.h"

namespace imuscope::ixblue_stdbin {
namespace {

/// The slowest usual output is 1 Hz.
constexpr Duration kSilence = std::chrono::seconds(3);

}  // namespace

Session::Session() noexcept : ListeningSession(kSilence) {}

bool Session::hear(std::span<const std::uint8_t> bytes, HostTime now) noexcept {
  return scanner_hears<Frame>(scanner_, bytes, now,
                              [](const Frame& frame) { return frame.kind == Frame::Kind::kTelegram; });
}

std::string_view Session::nothing_comes() const noexcept {
  return "no data from the unit: check cable and port, and that the unit's output is switched on";
}

std::string_view Session::nothing_is_understood() const noexcept {
  if (scanner_.unsupported_versions() > 0) {
    return "the unit sends StdBin V6, which is not read: set its output protocol to STDBIN V5 or lower";
  }
  return "bytes arrive but no StdBin telegram: check the baud rate, and that the unit's "
         "output protocol is STDBIN V2 to V5";
}

}  // namespace imuscope::ixblue_stdbin
