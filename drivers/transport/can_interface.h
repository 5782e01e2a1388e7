#pragma once

/// What the system knows of a CAN interface, and what is wrong with it in words for a person. Non-real-time
/// only.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"

namespace imuscope {

/// State of a controller by its error counters: warning from 96 on, passive from 128, off from 256.
enum class CanControllerState : std::uint8_t {
  kUnknown,  ///< an interface without a controller
  kActive,
  kWarning,
  kPassive,
  kBusOff,
  kStopped,
  kSleeping,
};
[[nodiscard]] std::string_view name_of(CanControllerState state);

struct CanInterface {
  std::string name;
  std::string kind;  ///< "can", "vcan", "vxcan"
  bool is_up = false;
  bool takes_fd = false;
  CanControllerState state = CanControllerState::kUnknown;
  bool listen_only = false;
  std::uint32_t bit_rate = 0;              ///< bit/s; 0 where there is none, or none is known
  std::uint32_t data_bit_rate = 0;         ///< of CAN FD
  std::uint32_t restart_ms = 0;            ///< after bus-off; 0: never by itself
  std::optional<std::uint16_t> tx_errors;  ///< the controller's error counters, where it shows them
  std::optional<std::uint16_t> rx_errors;
  std::uint64_t frames_received = 0;      ///< of any identifier, since the interface was made
  std::uint64_t controller_overruns = 0;  ///< frames that its controller had no room for
};

/// Names of the CAN interfaces of this PC, sorted.
[[nodiscard]] std::vector<std::string> can_interfaces();

/// What netlink says of an interface.
/// Errors: it does not exist (the others there are are named), or it is not a CAN interface.
[[nodiscard]] Result<CanInterface> look_at_can_interface(const std::string& name);

/// What was seen of a CAN device since one look at its interface before.
struct CanObservation {
  double silent_s = 0.0;  ///< since the last frame with an identifier in use, or since the line was opened
  std::uint64_t other_frames = 0;    ///< that the interface received since the last look
  std::uint64_t error_frames = 0;    ///< since the last look
  std::uint64_t frames_dropped = 0;  ///< since the last look
  std::string ids;                   ///< in use, for the text: "0AA, 0B4"
};

/// What is wrong, with the remedy, in one sentence; empty when all is well.
[[nodiscard]] std::string explain_can_trouble(const CanInterface& interface, const CanObservation& seen);

}  // namespace imuscope
