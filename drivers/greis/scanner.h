#pragma once

/// Finds GREIS messages and lines of text in a byte stream. After a false start the search goes on at the
/// byte after it. CR and LF between messages are separators. Core: bounded memory, no allocation, noexcept.
///
/// A message counts as found when its checksum is right: the last byte of the body, its last two hex digits
/// ([MF], [PM]), or its last two bytes ([rE], [rM], [rV]: CRC-16). [JP], [RE] and [ER] have none; they must
/// be text to the last byte.

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/time.h"
#include "drivers/device/scan_loop.h"
#include "drivers/greis/wire.h"

namespace imuscope::greis {

/// One GREIS message or line of text; its spans point into the scanner's buffer.
struct Frame {
  enum class Kind : std::uint8_t { kMessage, kText };
  Kind kind = Kind::kMessage;
  std::uint16_t id = 0;                 ///< of a message; see id_of()
  std::span<const std::uint8_t> bytes;  ///< whole message or line; valid until the next append()
  std::span<const std::uint8_t> body;   ///< of a message, checksum included
  std::uint64_t offset = 0;             ///< of its first byte in the stream
  HostTime first_byte{};                ///< when its first byte arrived at the latest
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
  ScanLoop<2 * kMessageMax> loop_;
};

/// The protocol's 8-bit checksum of the bytes before it.
[[nodiscard]] std::uint8_t checksum(std::span<const std::uint8_t> bytes) noexcept;

/// CRC-16 of [rE], [rM] and [rV]: polynomial 0x1021, from 0.
[[nodiscard]] std::uint16_t crc16(std::span<const std::uint8_t> bytes) noexcept;

}  // namespace imuscope::greis
