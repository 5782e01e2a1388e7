#pragma once

/// A serial line by termios2 alone: any baud rate (read back and compared), raw, exclusive, nonblocking.
/// Works on UARTs, USB adapters and pseudo-terminals; what only some of them can do (low latency, error
/// counts) is best effort and never a reason to fail.
///
/// A port whose device vanished is to be opened again by its stable name (/dev/serial/by-id/...).

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "base/result.h"
#include "drivers/transport/transport.h"

namespace imuscope {

/// Which port to open and how to set its line; always eight data bits, no parity, no flow control.
struct SerialSettings {
  std::string path;
  std::uint32_t baud = 115200;
  int stop_bits = 1;  ///< 1 or 2; XSens devices made before 2008 want 2
};

/// Counts of the kernel's tty driver since boot.
struct LineErrors {
  int frame = 0;
  int overrun = 0;
  int parity = 0;
  int break_marks = 0;
  int buffer_overrun = 0;
};

class SerialPort final : public Transport {
 public:
  /// Opens and sets up the line. Bytes that came before are thrown away. Errors name the remedy: a missing
  /// port lists the ports there are, a busy one names who holds it. Not for the real-time thread.
  static Result<SerialPort> open(const SerialSettings& settings);

  SerialPort(SerialPort&& other) noexcept;
  SerialPort& operator=(SerialPort&& other) noexcept;
  SerialPort(const SerialPort&) = delete;
  SerialPort& operator=(const SerialPort&) = delete;
  ~SerialPort() override;

  [[nodiscard]] IoResult read(std::span<std::uint8_t> buffer) noexcept override;
  [[nodiscard]] IoResult write(std::span<const std::uint8_t> bytes) noexcept override;
  /// -1 after a move.
  [[nodiscard]] int fd() const noexcept override { return fd_; }
  /// Dropped: overruns of the UART and of the kernel's buffer since the port was opened, where the driver
  /// counts them.
  [[nodiscard]] LineHealth health() noexcept override;
  /// By the rate that the driver gives, and the latency timer of the adapter as it was when it was opened.
  [[nodiscard]] LineTiming timing() const noexcept override { return timing_; }
  [[nodiscard]] std::string describe() const override;

  /// As the driver gives it, within 2 % of what was asked for.
  [[nodiscard]] double baud() const noexcept { return baud_; }
  /// Whether the driver was told to deliver bytes at once. False where it cannot: FTDI adapters then hold
  /// bytes for up to 16 ms (remedy: the udev rule ATTR{latency_timer}="1"); others have no such timer.
  [[nodiscard]] bool low_latency() const noexcept { return low_latency_; }
  /// Nothing where the driver does not count.
  [[nodiscard]] std::optional<LineErrors> line_errors() const noexcept;

 private:
  SerialPort(std::string path, int fd) noexcept : path_(std::move(path)), fd_(fd) {}
  void close() noexcept;

  std::string path_;
  int fd_ = -1;
  double baud_ = 0.0;
  LineTiming timing_;
  bool low_latency_ = false;
  std::int64_t overruns_at_open_ = 0;
};

}  // namespace imuscope
