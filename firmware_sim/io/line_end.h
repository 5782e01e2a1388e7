#pragma once

/// The simulator's end of a line that a program opens by the other.

#include <cstddef>
#include <span>

#include "firmware_sim/devices/bytes.h"

namespace imusim {

class LineEnd {
 public:
  virtual ~LineEnd() = default;

  /// Writes towards the program; never waits. What does not fit, or nobody is there to read, is dropped (a
  /// line that keeps some of it says so).
  /// @return how many bytes were dropped
  virtual std::size_t write(std::span<const std::uint8_t> bytes) = 0;

  /// What the program has written since the last call; never waits.
  virtual Bytes read() = 0;

  /// The speed that the program has set, bit/s; 0 for a line without one.
  [[nodiscard]] virtual int baud() const = 0;

 protected:
  LineEnd() = default;
  LineEnd(const LineEnd&) = default;
  LineEnd(LineEnd&&) = default;
  LineEnd& operator=(const LineEnd&) = default;
  LineEnd& operator=(LineEnd&&) = default;
};

}  // namespace imusim
