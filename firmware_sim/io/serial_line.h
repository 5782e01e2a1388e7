#pragma once

/// From a device's UART to the host's read(): bytes leave one after another at the line's speed, wait in the
/// USB adapter, and reach the host in reads that have an arrival time.

#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "firmware_sim/devices/device.h"
#include "firmware_sim/io/pc_clock.h"
#include "firmware_sim/random/random.h"

namespace imusim {

/// When the host reads what has arrived.
enum class ReadModel {
  kMessages,   ///< after each message: a built-in UART and a driver that waits
  kUsbFrames,  ///< at each 1 ms frame of the USB
  kFtdi,       ///< when the adapter has 62 bytes, or 16 ms after it last sent, at the next 1 ms frame
};

/// While it lasts, the host reads only at its beginning plus whole multiples of every_s, and at its end.
struct HeldReads {
  double begin_s;
  double end_s;
  double every_s;
};

/// While it lasts, what the device sends is lost.
struct Unplugged {
  double begin_s;
  double end_s;
  std::function<void(std::size_t bytes)>
      on_unheard{};  ///< told of each message that lost bytes; may be empty
};

struct LineOptions {
  ReadModel reads = ReadModel::kUsbFrames;
  int baud = 115200;
  double jitter_mean_s = 30e-6;    ///< mean delay of a read, exponentially distributed: the host's scheduler
  double usb_phase_s = 0.0;        ///< time of a USB frame
  std::int64_t host_begin_ns = 0;  ///< the host's clock at the scenario's time 0
  PcClock clock;
  std::vector<HeldReads> holds;
  std::vector<Unplugged> unplugged;
};

/// The line from one device to the host. Emissions go in as they are made, reads come out in order.
class SerialLine {
 public:
  using OnRead = std::function<void(std::span<const std::uint8_t> bytes, std::int64_t arrival_ns)>;

  SerialLine(const LineOptions& options, const Random& random) : options_(options), random_(random) {}

  void send(const Emission& emission);

  /// Speed of what is sent from now on.
  void set_baud(int baud) { options_.baud = baud; }

  /// Hands out the reads that end before t_s. Whatever is sent later must be ready no earlier than t_s.
  void deliver_until(double t_s, const OnRead& on_read);

 private:
  struct Byte {
    double done_s;  ///< its stop bit is on the line
    std::uint8_t value;
    bool ends_message;
  };
  /// When the next read takes place and how many bytes it takes, as far as the bytes in hand tell.
  struct NextRead {
    double at_s;
    std::size_t count;
  };
  [[nodiscard]] NextRead next_read() const;
  [[nodiscard]] NextRead unheld_read() const;
  [[nodiscard]] double held_until(double t_s) const;
  [[nodiscard]] const Unplugged* unplugged_at(double t_s) const;
  [[nodiscard]] NextRead next_ftdi_read() const;
  [[nodiscard]] double next_usb_frame(double t_s) const;

  LineOptions options_;
  Random random_;
  std::deque<Byte> waiting_;
  double free_at_s_ = -1e300;           ///< when the line has sent all it was given
  std::optional<double> flushed_at_s_;  ///< when the adapter last sent
  std::int64_t last_arrival_ns_ = 0;
  Bytes read_;
};

}  // namespace imusim
