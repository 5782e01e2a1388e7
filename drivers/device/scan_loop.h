#pragma once

/// The loop that finds frames in a stream, shared by protocols whose frame begins with a mark and proves
/// itself by a checksum: after a bad checksum or length the search goes on at the byte after the false
/// start, so that no good frame inside garbage is lost. Core: bounded memory, no allocation, noexcept.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "drivers/device/frame_buffer.h"

namespace imuscope {

enum class Verdict : std::uint8_t {
  kNeedMore,
  kFrame,
  kSeparator,  ///< stands between frames and belongs to none
  kFalseStart,
  kBadChecksum,
  kBadLength,
};

/// What the pending bytes begin with.
struct Examined {
  Verdict verdict;
  std::size_t size = 0;   ///< of a frame
  std::uint8_t kind = 0;  ///< of a frame, the protocol's own
};

/// What a scanner met since its construction: bytes that belong to no good frame, and frames that failed their
/// checksum or announced an impossible length. A line may be opened in the midst of a message, and the rest of
/// it may look like the start of another: until the first good frame bytes are skipped, and nothing is called
/// damaged.
struct ScanCounters {
  std::uint64_t bytes_skipped = 0;
  std::uint64_t bad_checksums = 0;
  std::uint64_t bad_lengths = 0;
};

template <std::size_t Capacity>
class ScanLoop {
 public:
  explicit ScanLoop(Duration per_byte) noexcept : buffer_(per_byte) {}

  /// Time of one byte on the wire, see byte_time(); of a line that may change its rate.
  [[nodiscard]] Duration per_byte() const noexcept { return buffer_.per_byte(); }
  void set_per_byte(Duration per_byte) noexcept { buffer_.set_per_byte(per_byte); }

  /// See FrameBuffer::append().
  std::size_t append(std::span<const std::uint8_t> bytes, HostTime arrival) noexcept {
    return buffer_.append(bytes, arrival);
  }

  /// The next frame, or nothing where more bytes are needed. bytes(), position() and first_byte() are about
  /// it until the next call.
  /// @param examine  of the pending bytes (not empty) to Examined
  /// @param at_end   no more bytes will come: look for frames after a start that announced more
  template <typename Examine>
  [[nodiscard]] std::optional<Examined> next(Examine&& examine, bool at_end) noexcept {
    buffer_.consume(taken_);
    taken_ = 0;
    for (auto pending = buffer_.pending(); !pending.empty(); pending = buffer_.pending()) {
      const Examined found = examine(pending);
      switch (found.verdict) {
        case Verdict::kFrame:
          taken_ = found.size;
          in_step_ = true;
          return found;
        case Verdict::kSeparator:
          buffer_.consume(1);
          continue;
        case Verdict::kNeedMore:
          if (!at_end) return std::nullopt;
          break;
        case Verdict::kBadChecksum:
          counters_.bad_checksums += in_step_ ? 1 : 0;
          break;
        case Verdict::kBadLength:
          counters_.bad_lengths += in_step_ ? 1 : 0;
          break;
        case Verdict::kFalseStart:
          break;
      }
      ++counters_.bytes_skipped;
      buffer_.consume(1);
    }
    return std::nullopt;
  }

  [[nodiscard]] std::span<const std::uint8_t> bytes() const noexcept {
    return buffer_.pending().first(taken_);
  }
  [[nodiscard]] std::uint64_t position() const noexcept { return buffer_.position(); }
  [[nodiscard]] HostTime first_byte() const noexcept { return buffer_.arrival_of(0); }
  [[nodiscard]] const ScanCounters& counters() const noexcept { return counters_; }

 private:
  FrameBuffer<Capacity> buffer_;
  std::size_t taken_ = 0;
  bool in_step_ = false;  ///< a good frame has come
  ScanCounters counters_;
};

}  // namespace imuscope
