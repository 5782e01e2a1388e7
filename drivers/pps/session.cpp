#include "drivers/pps/session.h"

#include "drivers/device/pulse_record.h"

namespace imuscope::pps {

namespace {

constexpr Duration kSilence = std::chrono::seconds(3);

}  // namespace

Session::Session() noexcept : ListeningSession(kSilence) {}

bool Session::hear(std::span<const std::uint8_t> bytes, HostTime) noexcept {
  // How the clock is steered may stand before it.
  return read_pulse_record(bytes).has_value() ||
         (bytes.size() >= kPulseRecordBytes &&
          read_pulse_record(bytes.subspan(kPulseRecordBytes)).has_value());
}

std::string_view Session::nothing_comes() const noexcept {
  return "no pulse comes; check that the receiver has a fix and its pulse is switched on, the wire, "
         "and the other edge (sudo ppstest DEVICE shows both)";
}

std::string_view Session::nothing_is_understood() const noexcept { return nothing_comes(); }

}  // namespace imuscope::pps
