#include "drivers/nmea/session.h"

namespace imuscope::nmea {
namespace {

/// Without a good message for this long something is wrong: the slowest usual output is 1 Hz.
constexpr Duration kSilence = std::chrono::seconds(5);

}  // namespace

Session::Session() noexcept : ListeningSession(kSilence) {}

bool Session::hear(std::span<const std::uint8_t> bytes, HostTime now) noexcept {
  return scanner_hears<Frame>(scanner_, bytes, now, [](const Frame&) { return true; });
}

std::string_view Session::nothing_comes() const noexcept {
  return "no data from the receiver: check cable and port, and that its NMEA output is switched on";
}

std::string_view Session::nothing_is_understood() const noexcept {
  return "bytes arrive but no NMEA sentence: check the baud rate, and that the receiver puts out GGA and RMC";
}

}  // namespace imuscope::nmea
