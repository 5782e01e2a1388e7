#pragma once

/// Finds UBX messages in a byte stream, and the NMEA sentences that most receivers mix in. After a false
/// start the search goes on at the byte after it. Core: bounded memory, no allocation, noexcept.

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/time.h"
#include "drivers/device/scan_loop.h"
#include "drivers/ubx/wire.h"

namespace imuscope::ubx {

/// One UBX message or NMEA sentence with a right checksum; its spans point into the scanner's buffer.
struct Frame {
  enum class Kind : std::uint8_t { kMessage, kNmea };
  Kind kind = Kind::kMessage;
  std::uint8_t message_class = 0;
  std::uint8_t id = 0;
  std::span<const std::uint8_t> bytes;    ///< whole frame; valid until the next append()
  std::span<const std::uint8_t> payload;  ///< of a message
  std::uint64_t offset = 0;               ///< of its first byte in the stream
  HostTime first_byte{};                  ///< when its first byte arrived at the latest
};

class Scanner {
 public:
  /// @param per_byte  time of one byte on the wire, zero for a network stream
  explicit Scanner(Duration per_byte = Duration::zero()) noexcept : loop_(per_byte) {}

  /// Time of one byte on the wire, see DeviceDecoder::set_per_byte().
  [[nodiscard]] Duration per_byte() const noexcept { return loop_.per_byte(); }
  void set_per_byte(Duration per_byte) noexcept { loop_.set_per_byte(per_byte); }

  /// Takes as many bytes as fit; see FrameBuffer::append(). Drain next() after every call.
  std::size_t append(std::span<const std::uint8_t> bytes, HostTime arrival) noexcept {
    return loop_.append(bytes, arrival);
  }

  /// The next frame, or false where more bytes are needed.
  /// @param at_end  no more bytes will come: look for frames after a start that announced more
  [[nodiscard]] bool next(Frame& frame, bool at_end = false) noexcept;

  [[nodiscard]] const ScanCounters& counters() const noexcept { return loop_.counters(); }

 private:
  ScanLoop<2 * (kHeaderSize + kPayloadMax + kChecksumSize)> loop_;
};

}  // namespace imuscope::ubx
