#pragma once

/// Error frames: what the kernel's CAN driver says of the bus and of its controller, in the form of a frame.
/// Layout: <linux/can/error.h>; written out here, since captures are read on systems without CAN, too.

#include <cstdint>
#include <optional>
#include <string>

#include "drivers/device/can_frame.h"

namespace imuscope {

/// State of a controller: warning from 96 errors on, passive from 128, off the bus from 256.
enum class CanBusState : std::uint8_t { kActive, kWarning, kPassive, kOff };

/// What one error frame says.
struct CanErrorReport {
  std::optional<CanBusState> state;  ///< the controller's new state
  bool restarted = false;            ///< the controller is on the bus again
  bool receive_overflow = false;     ///< the controller had no room: frames are lost
  bool transmit_overflow = false;
  bool not_acknowledged = false;  ///< nobody else is awake on the bus
  bool bus_error = false;         ///< a damaged frame was seen
  bool has_counts = false;
  std::uint8_t transmit_errors = 0;
  std::uint8_t receive_errors = 0;
};

/// @param frame  with is_error
/// Core: no allocation.
[[nodiscard]] CanErrorReport read_can_error(const CanFrame& frame) noexcept;

/// The same for a person: "bus-off", "controller: transmit warning; errors: transmit 96, receive 7".
[[nodiscard]] std::string describe_can_error(const CanFrame& frame);

}  // namespace imuscope
