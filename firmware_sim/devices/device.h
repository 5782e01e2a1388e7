#pragma once

/// A device at the far end of a serial line: hears bytes, sends bytes, and knows when. Time is the
/// scenario's, in seconds, and runs only as the caller lets it; nothing here reads a clock.

#include <span>
#include <vector>

#include "firmware_sim/devices/bytes.h"

namespace imusim {

/// One message, and the instant at which the device begins to put it on the line.
struct Emission {
  double ready_s;
  Bytes bytes;
};

class Device {
 public:
  virtual ~Device() = default;

  /// The host wrote these bytes; they have arrived at t_s. Times must not fall, nor lie before run_until().
  virtual void receive(std::span<const std::uint8_t> bytes, double t_s) = 0;

  /// Lives until t_s, and appends what it sends until then in the order of sending.
  virtual void run_until(double t_s, std::vector<Emission>& out) = 0;

  /// The line's speed, bit/s; changes when the host has set another one and restarted the device.
  [[nodiscard]] virtual int baud() const = 0;
};

}  // namespace imusim
