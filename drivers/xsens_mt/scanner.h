#pragma once

/// Finds frames of the XSens MT protocol in a byte stream. After a bad checksum or length the search goes on
/// at the byte behind the false preamble. The checksum has 8 bits only, so that one false frame in 256 passes
/// it: where the bytes behind a taken frame are no frame, the bytes inside it are looked at again, and a good
/// frame that began in there is not lost. Core: bounded memory, no allocation, noexcept.

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/time.h"
#include "drivers/device/frame_buffer.h"
#include "drivers/xsens_mt/wire.h"

namespace imuscope::xsens {

struct Frame {
  std::uint8_t bid = 0;
  std::uint8_t mid = 0;
  std::span<const std::uint8_t> data;  ///< valid until the next append() or next()
  std::size_t size = 0;                ///< of the whole frame
  std::uint64_t offset = 0;            ///< of its preamble in the stream
  HostTime first_byte{};               ///< when its preamble arrived at the latest
};

struct ScanCounters {
  std::uint64_t bytes_skipped = 0;
  std::uint64_t bad_checksums = 0;
  std::uint64_t bad_lengths = 0;
};

class Scanner {
 public:
  /// @param per_byte  time of one byte on the wire, see byte_time()
  explicit Scanner(Duration per_byte = Duration::zero()) noexcept : buffer_(per_byte) {}

  /// Takes as many bytes as fit; see FrameBuffer::append(). Drain next() after every call.
  std::size_t append(std::span<const std::uint8_t> bytes, HostTime arrival) noexcept {
    return buffer_.append(bytes, arrival);
  }

  /// The next frame, or false where more bytes are needed.
  /// @param at_end  no more bytes will come: look for frames behind a preamble that announced more
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
  [[nodiscard]] static Verdict chain_across(std::span<const std::uint8_t> bytes, std::size_t start,
                                            std::size_t end) noexcept;
  [[nodiscard]] Verdict look_back(bool at_end) noexcept;
  void count(Verdict verdict) noexcept;

  // Pending bytes: the last frame taken (taken_ bytes; zero: none to look back into), then what follows it.
  FrameBuffer<2 * kFrameMax> buffer_;
  std::size_t taken_ = 0;
  ScanCounters counters_;
};

}  // namespace imuscope::xsens
