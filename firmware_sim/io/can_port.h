#pragma once

/// A CAN interface of this PC as the simulated devices' way out: a raw socket that sends classic frames.

#include <string>
#include <tl/expected.hpp>

#include "firmware_sim/devices/can_node.h"

namespace imusim {

class CanPort {
 public:
  /// @return what went wrong, in one sentence with the remedy
  static tl::expected<CanPort, std::string> open(const std::string& interface);

  CanPort(CanPort&& other) noexcept;
  CanPort& operator=(CanPort&&) = delete;
  CanPort(const CanPort&) = delete;
  CanPort& operator=(const CanPort&) = delete;
  ~CanPort();

  /// Sends a frame; never waits. @return false where the interface took none: it is down, or its queue full
  bool write(const CanFrame& frame);

  [[nodiscard]] const std::string& interface() const { return interface_; }

 private:
  CanPort(std::string interface, int socket) : interface_(std::move(interface)), socket_(socket) {}

  std::string interface_;
  int socket_;
};

}  // namespace imusim
