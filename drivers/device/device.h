#pragma once

/// What every device driver offers: a decoder (bytes to samples) and, for devices that must be spoken to, a
/// session (what to write, and in which state the device is). Neither does I/O: bytes and times are handed
/// in, so the same code serves a serial port, a capture and a test.

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string_view>
#include <vector>

#include "base/time.h"
#include "drivers/device/can_frame.h"
#include "sample/sample.h"

namespace imuscope {

/// Counts since construction. Every byte is accounted for: it belongs to a good frame or is skipped.
struct DecoderCounters {
  std::uint64_t bytes = 0;          ///< handed in
  std::uint64_t bytes_skipped = 0;  ///< belonged to no valid frame
  std::uint64_t frames = 0;         ///< valid frames
  std::uint64_t bad_checksums = 0;
  std::uint64_t bad_lengths = 0;
  std::uint64_t bad_contents = 0;  ///< checksum right, content not to be understood
  std::uint64_t samples = 0;       ///< handed to the sink
  std::uint64_t samples_lost = 0;  ///< missing according to the device's own counter or time tags
  std::uint64_t clock_resets = 0;  ///< the device's count was not continuable: a new segment began
};

/// The instants of one read. A plain instant stands for both.
struct Arrival {
  HostTime read{};  ///< it was made: which tick consumes what it brought follows from this
  /// Its last byte had come, as the kernel or the interface say where they do; never after `read`. Clocks are
  /// learned by this.
  HostTime received{};

  constexpr Arrival() noexcept = default;
  constexpr Arrival(HostTime at) noexcept : read(at), received(at) {}
  constexpr Arrival(HostTime read_at, HostTime received_at) noexcept : read(read_at), received(received_at) {}
};

/// Turns the byte stream of one device into samples. Core: no allocation, no exception after construction.
class DeviceDecoder {
 public:
  virtual ~DeviceDecoder() = default;

  /// Decodes one read. Frames may span reads; samples come out in stream order.
  /// @param bytes    what the read returned
  /// @param arrival  host times of the read
  virtual void push(std::span<const std::uint8_t> bytes, Arrival arrival, SampleSink& sink) noexcept = 0;

  /// The stream has ended (end of a recording, never needed live): decodes what waited for more bytes, such
  /// as a last line without its end, or a frame after a false start that announced more than came.
  virtual void finish(HostTime arrival, SampleSink& sink) noexcept {
    (void)arrival;
    (void)sink;
  }

  [[nodiscard]] virtual const DecoderCounters& counters() const noexcept = 0;

  /// Time of one byte on the wire from now on: the line was opened at a rate. What is stamped by its first
  /// byte is dated back by it. Without effect where bytes do not come over a serial line.
  virtual void set_per_byte(Duration per_byte) noexcept { (void)per_byte; }
  /// Zero where there is none.
  [[nodiscard]] virtual Duration per_byte() const noexcept { return Duration::zero(); }

  /// Of a device on a CAN bus: the frames that it needs, so that the kernel lets through only those. Empty
  /// for every other device. Not for the real-time thread.
  [[nodiscard]] virtual std::vector<CanId> ids() const { return {}; }

  /// What is wrong with the data although they can be read, in one sentence with the remedy; empty where
  /// nothing is. Static storage.
  [[nodiscard]] virtual std::string_view remark() const noexcept { return {}; }

  /// Device time per host time, minus 1, in parts per million: the device's clock is fast where positive. NaN
  /// where the device has no clock or too little was seen of it.
  [[nodiscard]] virtual double clock_drift_ppm() const noexcept {
    return std::numeric_limits<double>::quiet_NaN();
  }

  /// How well the device's clock is known on the host's: scatter of what binds their relation; NaN as above.
  [[nodiscard]] virtual double clock_sd_s() const noexcept {
    return std::numeric_limits<double>::quiet_NaN();
  }
};

enum class SessionState : std::uint8_t {
  kConnecting,   ///< looking for the device
  kConfiguring,  ///< the device answers and is being set up
  kStreaming,    ///< the device sends what was asked for
  kFailed,       ///< gave up; problem() says why and what to do
};

/// Speaks with a device until it streams what the configuration asks for. Core: no allocation after
/// construction. A device that only sends (no handshake) has a session that is kStreaming with its first
/// frame.
class DeviceSession {
 public:
  virtual ~DeviceSession() = default;

  /// Hands in the bytes of a read (the same ones that the decoder gets).
  virtual void on_bytes(std::span<const std::uint8_t> bytes, HostTime now) noexcept = 0;

  /// What to write to the device now; empty when there is nothing to say. Call after on_bytes() and at least
  /// every 10 ms. The span is valid until the next call.
  [[nodiscard]] virtual std::span<const std::uint8_t> poll(HostTime now) noexcept = 0;

  [[nodiscard]] virtual SessionState state() const noexcept = 0;

  /// True where all signs are that the line runs at another baud rate: nothing that came was a message. The
  /// owner of the line may open it at another one, with a new session.
  [[nodiscard]] virtual bool wants_other_baud() const noexcept { return false; }

  /// Last problem in one sentence, with the remedy; empty when there is none. Static or member storage.
  [[nodiscard]] virtual std::string_view problem() const noexcept = 0;
};

}  // namespace imuscope
