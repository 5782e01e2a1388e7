#pragma once

/// A line to a device, whatever it is made of: a serial port, a CAN interface, a network connection. Bytes go
/// in and out without ever blocking; waiting is the caller's: put fd() into epoll. A line whose far end
/// vanished says kGone from then on; destroy it and open it again.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "base/time.h"

namespace imuscope {

enum class IoStatus : std::uint8_t {
  kDone,     ///< n bytes were moved, n > 0
  kNothing,  ///< nothing to read, or no room to write, now
  kGone,     ///< the device vanished (unplugged, other end closed)
};

/// What one read() or write() did. `n`, the bytes moved, is above zero with kDone only.
struct IoResult {
  IoStatus status = IoStatus::kNothing;
  std::size_t n = 0;
  bool more = false;  ///< of a read: the buffer was too small for all that waits
  /// Of a read: when the kernel, or the card, received its last byte, where that is known.
  std::optional<HostTime> received{};
};

/// Who says when something arrived, the better the further down.
enum class StampedBy : std::uint8_t {
  kRead,       ///< nobody: the read itself
  kKernel,     ///< the kernel, as its driver handed the bytes over
  kInterface,  ///< the interface, by a clock of its own
};

/// How well the arrivals of a line are stamped.
struct StampQuality {
  StampedBy by = StampedBy::kRead;
  double lead_s = 0.0;     ///< mean, by which the stamps are before the reads
  double lead_sd_s = 0.0;  ///< of single ones: jitter that stamps of the reads would have
};

/// What a line does to the times of bytes, as it was opened.
struct LineTiming {
  Duration per_byte{};  ///< on the wire, at the rate in force; zero where the line has no rate of its own
  Duration held{};      ///< an adapter may keep bytes for so long before it hands them on; zero: none known
};

/// What a line says about itself besides its bytes.
struct LineHealth {
  bool is_up =
      true;  ///< false while the line is there and cannot carry anything, as a CAN interface that is down
  std::uint64_t frames_dropped = 0;  ///< arrived, and lost by this PC before they could be read
  StampQuality stamps{};
};

class Transport {
 public:
  virtual ~Transport() = default;

  /// Never blocks. Core: no allocation.
  [[nodiscard]] virtual IoResult read(std::span<std::uint8_t> buffer) noexcept = 0;
  /// Never blocks; may move fewer bytes than given. Core: no allocation.
  [[nodiscard]] virtual IoResult write(std::span<const std::uint8_t> bytes) noexcept = 0;

  /// For epoll: EPOLLIN, and EPOLLHUP or EPOLLERR when the device vanishes.
  [[nodiscard]] virtual int fd() const noexcept = 0;

  /// Core: no allocation.
  [[nodiscard]] virtual LineHealth health() noexcept { return {}; }

  /// Core: no allocation.
  [[nodiscard]] virtual LineTiming timing() const noexcept { return {}; }

  /// Which line this is and how it is set, for a log: "/dev/ttyUSB0 at 115200 baud".
  [[nodiscard]] virtual std::string describe() const = 0;

 protected:
  Transport() = default;
  Transport(const Transport&) = default;
  Transport(Transport&&) = default;
  Transport& operator=(const Transport&) = default;
  Transport& operator=(Transport&&) = default;
};

}  // namespace imuscope
