#include "drivers/ubx/session.h"

namespace imuscope::ubx {
namespace {

/// Without a good message for this long something is wrong: the slowest usual output is 1 Hz.
constexpr Duration kSilence = std::chrono::seconds(5);

}  // namespace

Session::Session() noexcept : ListeningSession(kSilence) {}

bool Session::hear(std::span<const std::uint8_t> bytes, HostTime now) noexcept {
  return scanner_hears<Frame>(scanner_, bytes, now, [](const Frame& frame) {
    return frame.kind == Frame::Kind::kMessage && frame.message_class == kClassNav && frame.id == kIdPvt;
  });
}

std::string_view Session::nothing_comes() const noexcept {
  return "no data from the receiver: check cable and port";
}

std::string_view Session::nothing_is_understood() const noexcept {
  return "bytes arrive but no UBX-NAV-PVT: check the baud rate, and switch the message on for this port "
         "(CFG-MSG, or CFG-MSGOUT-UBX_NAV_PVT)";
}

}  // namespace imuscope::ubx
