#pragma once

/// A device at the far end of a serial line: hears bytes, sends bytes, and knows when. Time is the
/// scenario's, in seconds, and runs only as the caller lets it; nothing here reads a clock.

#include <span>
#include <string>
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

  /// Power fails at t_s and is back off_s later; what is not kept without power is forgotten. Times as in
  /// receive().
  virtual void power_cycle(double t_s, double off_s) = 0;

  /// From the next sample on, the device's clock is ahead of where it was by this much.
  virtual void jump_clock(double by_s) = 0;

  /// From the next sample on, the device's clock is fast by this much more than it was.
  virtual void add_skew(double ppm) = 0;

  /// From the next message on these blocks are left out, by the names that the device's protocol has for
  /// them. Returns false where it knows no such block.
  virtual bool leave_out(const std::vector<std::string>& blocks) = 0;

  /// The line's speed, bit/s; changes when the host has set another one and restarted the device.
  [[nodiscard]] virtual int baud() const = 0;
};

}  // namespace imusim
