#pragma once

/// The bytes of a stream between two reads: what a scanner looks at while a wire frame is not complete yet.
/// Bounded: holds Capacity bytes and no more. Remembers when each byte was on the wire, so that a frame whose
/// bytes came with several reads is stamped by its first one. Core: no allocation, noexcept.

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

#include "base/time.h"

namespace imuscope {

/// Start bit and eight data bits.
inline constexpr double kBitsBeforeStop = 9.0;

/// Time of one byte on a serial line; zero where `baud` is zero (the stream does not come over a serial
/// line).
/// @param stop_bits  1 or 2
inline Duration byte_time(double baud, int stop_bits = 1) {
  return baud > 0.0 ? from_seconds((kBitsBeforeStop + stop_bits) / baud) : Duration::zero();
}

/// @tparam Capacity  at least the longest frame; twice that keeps copying low
template <std::size_t Capacity>
class FrameBuffer {
 public:
  /// @param per_byte  time of one byte on the wire, see byte_time()
  explicit FrameBuffer(Duration per_byte = Duration::zero()) noexcept : per_byte_(per_byte) {}

  /// Takes as many bytes as fit and returns how many. Call again with the rest of the same read, and the same
  /// arrival, after consume() has made room.
  /// @param bytes    what is left of the read
  /// @param arrival  host time of the read: its last byte is taken to have arrived then, not later
  std::size_t append(std::span<const std::uint8_t> bytes, HostTime arrival) noexcept {
    if (bytes.size() > Capacity - end_) move_to_front();
    const std::size_t n = std::min(bytes.size(), Capacity - end_);
    if (n == 0) return 0;
    std::memcpy(bytes_.data() + end_, bytes.data(), n);
    end_ += n;
    const std::uint64_t read_end = position_ + (end_ - begin_) + (bytes.size() - n);
    remember_read(read_end, arrival);
    return n;
  }

  [[nodiscard]] std::span<const std::uint8_t> pending() const noexcept {
    return {bytes_.data() + begin_, end_ - begin_};
  }

  [[nodiscard]] bool full() const noexcept { return end_ - begin_ == Capacity; }

  /// Forgets the first `n` pending bytes. They stay readable until the next append().
  void consume(std::size_t n) noexcept {
    begin_ += n;
    position_ += n;
    while (n_reads_ > 1 && reads_[first_read_].end <= position_) {
      first_read_ = (first_read_ + 1) % kReads;
      --n_reads_;
    }
  }

  /// When the pending byte `index` arrived at the latest: the arrival of its read minus the time on the wire
  /// of the bytes from it to the end of that read.
  [[nodiscard]] HostTime arrival_of(std::size_t index) const noexcept {
    const std::uint64_t at = position_ + index;
    for (std::size_t i = 0; i < n_reads_; ++i) {
      const Read& read = reads_[(first_read_ + i) % kReads];
      if (at < read.end) return read.arrival - per_byte_ * static_cast<std::int64_t>(read.end - at);
    }
    return {};
  }

  /// Stream offset of pending()[0], counted from the first byte ever appended.
  [[nodiscard]] std::uint64_t position() const noexcept { return position_; }

  [[nodiscard]] Duration per_byte() const noexcept { return per_byte_; }
  /// The line runs at another rate from now on.
  void set_per_byte(Duration per_byte) noexcept { per_byte_ = per_byte; }

 private:
  /// Reads whose bytes may be pending at the same time. Where there are more, the newest ones are taken for
  /// one read: a stamp is later then, never earlier.
  static constexpr std::size_t kReads = 64;
  struct Read {
    std::uint64_t end = 0;  ///< stream offset after the read's last byte
    HostTime arrival{};
  };

  void move_to_front() noexcept {
    std::memmove(bytes_.data(), bytes_.data() + begin_, end_ - begin_);
    end_ -= begin_;
    begin_ = 0;
  }

  void remember_read(std::uint64_t read_end, HostTime arrival) noexcept {
    Read* last = n_reads_ > 0 ? &reads_[(first_read_ + n_reads_ - 1) % kReads] : nullptr;
    if (last != nullptr && last->end == read_end) return;
    if (n_reads_ == kReads) {
      *last = {read_end, arrival};
      return;
    }
    reads_[(first_read_ + n_reads_) % kReads] = {read_end, arrival};
    ++n_reads_;
  }

  std::array<std::uint8_t, Capacity> bytes_{};
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
  std::uint64_t position_ = 0;
  Duration per_byte_;
  std::array<Read, kReads> reads_{};
  std::size_t first_read_ = 0;
  std::size_t n_reads_ = 0;
};

}  // namespace imuscope
