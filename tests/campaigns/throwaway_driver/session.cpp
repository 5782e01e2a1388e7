#include "drivers/throwaway/session.h"

namespace imuscope::throwaway {

Session::Session() noexcept : ListeningSession(std::chrono::seconds(2)) {}

bool Session::hear(std::span<const std::uint8_t> bytes, HostTime now) noexcept {
  return scanner_hears<Frame>(scanner_, bytes, now, [](const Frame&) { return true; });
}

std::string_view Session::nothing_comes() const noexcept {
  return "no data from the device: check cable and port";
}

std::string_view Session::nothing_is_understood() const noexcept {
  return "bytes arrive but no frame: check the baud rate";
}

}  // namespace imuscope::throwaway
