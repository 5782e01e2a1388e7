#pragma once

/// Finds frames of the XSens MT protocol in a byte stream. After a bad checksum or length the search goes on
/// at the byte after the false preamble.
///
/// The checksum has only 8 bits, so one false start in 256 passes it and covers what lies in its length.
/// No good frame is lost to that:
/// - A frame that lies whole inside another one is given as well, marked `nested`: one of the two is false,
///   and only their contents tell which. Those who act on frames take data out of nested ones, and no
///   command.
/// - Where the bytes after a taken frame are no frame, a good one that began inside it and ends after it is
///   found. What remains is a false frame that passes, covers the beginning of a good one, and is followed,
///   inside that good one, by a second false start that passes too: 2^-16 for each false start whose length
///   does so.
///
/// Core: bounded memory, no allocation, noexcept.

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/time.h"
#include "drivers/device/frame_buffer.h"
#include "drivers/xsens_mt/wire.h"

namespace imuscope::xsens {

/// One message: bus identifier (0xFF: the only device, or the Xbus Master), message identifier, data.
struct Frame {
  std::uint8_t bid = 0;
  std::uint8_t mid = 0;
  std::span<const std::uint8_t> data;  ///< valid until the next append() or next()
  std::size_t size = 0;                ///< of the whole frame
  std::uint64_t offset = 0;            ///< of its preamble in the stream
  HostTime first_byte{};               ///< when its preamble arrived at the latest
  bool nested = false;                 ///< lies inside the frame that was given before
};

/// What the scanner met since its construction. Until the first good frame bytes are skipped, and nothing is
/// called damaged: it may be the rest of a message that the line was opened in.
struct ScanCounters {
  std::uint64_t bytes_skipped = 0;
  std::uint64_t bad_checksums = 0;
  std::uint64_t bad_lengths = 0;
};

class Scanner {
 public:
  /// @param per_byte  time of one byte on the wire, see byte_time()
  explicit Scanner(Duration per_byte = Duration::zero()) noexcept : buffer_(per_byte) {}

  /// Time of one byte on the wire, see DeviceDecoder::set_per_byte().
  [[nodiscard]] Duration per_byte() const noexcept { return buffer_.per_byte(); }
  void set_per_byte(Duration per_byte) noexcept { buffer_.set_per_byte(per_byte); }

  /// Takes as many bytes as fit; see FrameBuffer::append(). Drain next() after every call.
  std::size_t append(std::span<const std::uint8_t> bytes, HostTime arrival) noexcept {
    return buffer_.append(bytes, arrival);
  }

  /// The next frame, or false where more bytes are needed.
  /// @param at_end  no more bytes will come: look for frames after a preamble that announced more
  [[nodiscard]] bool next(Frame& frame, bool at_end = false) noexcept;

  [[nodiscard]] const ScanCounters& counters() const noexcept { return counters_; }

 private:
  enum class Verdict : std::uint8_t { kNeedMore, kFrame, kFalseStart, kBadChecksum, kBadLength };
  struct Examined {
    Verdict verdict;
    std::size_t header = 0;
    std::size_t size = 0;
  };

  [[nodiscard]] static Examined examine(std::span<const std::uint8_t> bytes) noexcept;
  void fill(Frame& frame, std::size_t start, const Examined& found) const noexcept;
  [[nodiscard]] bool next_nested(Frame& frame) noexcept;
  [[nodiscard]] Verdict look_back(bool at_end) noexcept;
  void count(Verdict verdict) noexcept;

  // Pending bytes: the last frame taken (taken_ bytes; zero: none to look back into), then what follows it.
  FrameBuffer<2 * kFrameMax> buffer_;
  std::size_t taken_ = 0;
  bool in_step_ = false;       ///< a good frame has come
  std::size_t nested_at_ = 0;  ///< in the frame taken: where to look on for frames inside it
  ScanCounters counters_;
};

}  // namespace imuscope::xsens
