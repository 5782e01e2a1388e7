#pragma once

/// Finds NMEA 0183 sentences in a byte stream: '$' or '!', text, '*', two hex digits of checksum. After a
/// false start the search goes on at the byte after it. Core: bounded memory, no allocation, noexcept.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "base/time.h"
#include "drivers/device/scan_loop.h"

namespace imuscope::nmea {

/// The standard allows 82; receivers in RTK send longer ones.
inline constexpr std::size_t kSentenceMax = 256;

/// Whether `pending`, which begins with '$' or '!', begins with a sentence; its size is from there to the
/// last digit of the checksum.
/// @param checksum_required  false: a sentence without '*', ended by CR or LF, is taken too
[[nodiscard]] Examined examine_sentence(std::span<const std::uint8_t> pending,
                                        bool checksum_required = true) noexcept;

/// One sentence with a right checksum (or without one, where none is required); it points into the scanner's
/// buffer.
struct Frame {
  std::string_view sentence;  ///< from '$' to the checksum; valid until the next append()
  std::uint64_t offset = 0;   ///< of its first byte in the stream
  HostTime first_byte{};      ///< when its first byte arrived at the latest
};

class Scanner {
 public:
  explicit Scanner(Duration per_byte = Duration::zero(), bool checksum_required = true) noexcept
      : loop_(per_byte), checksum_required_(checksum_required) {}

  /// Time of one byte on the wire, see DeviceDecoder::set_per_byte().
  [[nodiscard]] Duration per_byte() const noexcept { return loop_.per_byte(); }
  void set_per_byte(Duration per_byte) noexcept { loop_.set_per_byte(per_byte); }

  /// Takes as many bytes as fit; see FrameBuffer::append(). Drain next() after every call.
  std::size_t append(std::span<const std::uint8_t> bytes, HostTime arrival) noexcept {
    return loop_.append(bytes, arrival);
  }

  /// The next sentence, or false where more bytes are needed.
  /// @param at_end  no more bytes will come
  [[nodiscard]] bool next(Frame& frame, bool at_end = false) noexcept;

  [[nodiscard]] const ScanCounters& counters() const noexcept { return loop_.counters(); }

 private:
  ScanLoop<8 * kSentenceMax> loop_;
  bool checksum_required_;
};

}  // namespace imuscope::nmea
