#pragma once

/// Cuts a stream of RTKLIB solutions into lines. Whether a line is a solution is the reader's to say: the
/// format has no checksum. Empty lines are passed over; of a line that is too long nothing is used. Core:
/// bounded memory, no allocation, noexcept.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "drivers/device/frame_buffer.h"

namespace imuscope::rtklib_pos {

/// Solutions are some 140 characters long, comments up to a path's length.
inline constexpr std::size_t kLineMax = 1024;
inline constexpr char kCommentMark = '%';

/// One line, comment or solution; it points into the scanner's buffer.
struct Frame {
  std::string_view
      line;              ///< without blanks before it and its end; never empty; valid until the next append()
  std::size_t size = 0;  ///< of the line, its end included
  std::uint64_t offset = 0;  ///< of its first byte in the stream
  HostTime first_byte{};     ///< when its first byte arrived at the latest
};

/// What the scanner passed over since its construction; there is no checksum that could fail.
struct ScanCounters {
  std::uint64_t bytes_skipped = 0;
  std::uint64_t bad_lengths = 0;  ///< lines that were too long
};

class Scanner {
 public:
  /// @param per_byte  time of one byte on the wire, zero for a network stream
  explicit Scanner(Duration per_byte = Duration::zero()) noexcept : buffer_(per_byte) {}

  /// Time of one byte on the wire, see DeviceDecoder::set_per_byte().
  [[nodiscard]] Duration per_byte() const noexcept { return buffer_.per_byte(); }
  void set_per_byte(Duration per_byte) noexcept { buffer_.set_per_byte(per_byte); }

  /// Takes as many bytes as fit; see FrameBuffer::append(). Drain next() after every call.
  std::size_t append(std::span<const std::uint8_t> bytes, HostTime arrival) noexcept {
    return buffer_.append(bytes, arrival);
  }

  /// The next line, or false where more bytes are needed.
  /// @param at_end  no more bytes will come: a last line needs no end
  [[nodiscard]] bool next(Frame& frame, bool at_end = false) noexcept;

  [[nodiscard]] const ScanCounters& counters() const noexcept { return counters_; }

 private:
  void skip(std::size_t n) noexcept;

  FrameBuffer<2 * kLineMax> buffer_;
  std::size_t taken_ = 0;
  bool in_long_line_ = false;
  ScanCounters counters_;
};

}  // namespace imuscope::rtklib_pos
