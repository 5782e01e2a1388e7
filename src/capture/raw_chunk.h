#pragma once

/// How the bytes of a read travel from an I/O thread to the recorder.

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <type_traits>

#include "base/contracts.h"
#include "base/limits.h"
#include "base/time.h"
#include "rt/byte_ring.h"
#include "sample/sample.h"

namespace imuscope {

enum class Direction : std::uint8_t {
  kRead,
  kWrite,
  kLine,  ///< nothing went either way: the line runs at another rate (line_rate_bytes())
  /// A read whose last byte had come earlier, as the kernel or the card say: the first kReceivedBytes bytes
  /// are that instant (received_bytes()), those that were read follow.
  kStampedRead,
};

/// Nanoseconds in a chunk, lowest byte first.
using NanosecondBytes = std::array<std::uint8_t, sizeof(std::int64_t)>;

[[nodiscard]] constexpr NanosecondBytes nanosecond_bytes(std::int64_t ns) noexcept {
  NanosecondBytes bytes{};
  auto rest = static_cast<std::uint64_t>(ns);
  for (std::uint8_t& byte : bytes) {
    byte = static_cast<std::uint8_t>(rest & 0xFFU);
    rest >>= 8U;
  }
  return bytes;
}
[[nodiscard]] constexpr std::int64_t nanoseconds_of(
    std::span<const std::uint8_t, sizeof(std::int64_t)> bytes) noexcept {
  std::uint64_t ns = 0;
  for (std::size_t i = bytes.size(); i-- > 0;) ns = ns << 8U | bytes[i];
  return static_cast<std::int64_t>(ns);
}

inline constexpr std::size_t kReceivedBytes = sizeof(std::int64_t);
/// What a chunk of Direction::kStampedRead begins with: CLOCK_MONOTONIC, ns.
[[nodiscard]] constexpr NanosecondBytes received_bytes(HostTime received) noexcept {
  return nanosecond_bytes(to_ns(received));
}

/// What a chunk of Direction::kLine holds: the time of one byte on the wire, ns.
[[nodiscard]] constexpr NanosecondBytes line_rate_bytes(Duration per_byte) noexcept {
  return nanosecond_bytes(per_byte.count());
}

/// The slowest line, of 50 baud, needs less than this for a byte.
inline constexpr Duration kLongestPerByte = std::chrono::seconds(1);

/// Nothing where the bytes of a recording are no such time.
[[nodiscard]] constexpr std::optional<Duration> line_rate_of(std::span<const std::uint8_t> bytes) noexcept {
  if (bytes.size() != sizeof(std::int64_t)) return std::nullopt;
  const std::int64_t ns = nanoseconds_of(bytes.first<sizeof(std::int64_t)>());
  if (ns <= 0 || ns > kLongestPerByte.count()) return std::nullopt;
  return Duration(ns);
}

inline constexpr std::size_t kRawChunkBytes = 1024;

/// What is said of a read from, or a write to, a device, or of a part of one that is longer than
/// kRawChunkBytes.
struct RawChunkInfo {
  std::int64_t sequence;  ///< counts the chunks of the device, from 0, refused ones included
  HostTime arrival;       ///< of the read or write
  DeviceIndex device;
  Direction direction;
  bool continues;  ///< the next chunk of this device holds more of the same read or write
};
static_assert(std::is_trivially_copyable_v<RawChunkInfo>);

/// A chunk: what is said of it, and its bytes, which are somebody else's.
struct RawChunk {
  RawChunkInfo info;
  std::span<const std::uint8_t> bytes;
};

/// Beside its bytes a chunk has what is said of it, its length, and up to a length of padding.
inline constexpr std::size_t kRawChunkExtraBytes = sizeof(RawChunkInfo) + 2 * sizeof(std::uint64_t);

/// Bytes of a ring that takes so much while the disk stands still for kRecordStall_s.
[[nodiscard]] constexpr std::size_t raw_ring_capacity(double bytes_per_s, double reads_per_s) noexcept {
  const double rate = bytes_per_s + static_cast<double>(kRawChunkExtraBytes) * reads_per_s;
  return std::clamp(ring_capacity(rate, kRecordStall_s), kRawRingBytesMin, kRawRingBytesMax);
}

/// From one I/O thread to the recorder. Threads, waits and losses: see ByteRing.
class RawRing {
 public:
  explicit RawRing(std::size_t capacity_bytes = kRawRingBytesMin) : ring_(capacity_bytes) {}

  [[nodiscard]] bool try_push(const RawChunk& chunk) noexcept {
    std::array<std::uint8_t, sizeof(RawChunkInfo)> head{};
    std::memcpy(head.data(), &chunk.info, sizeof chunk.info);
    return ring_.try_push(head, chunk.bytes);
  }
  /// The oldest chunk; its bytes lie in the ring until pop().
  [[nodiscard]] std::optional<RawChunk> front() noexcept {
    const auto record = ring_.front();
    if (record.empty()) return std::nullopt;
    RawChunk chunk{{}, record.subspan(sizeof(RawChunkInfo))};
    std::memcpy(&chunk.info, record.data(), sizeof chunk.info);
    return chunk;
  }
  void pop() noexcept { ring_.pop(); }
  [[nodiscard]] std::size_t capacity() const noexcept { return ring_.capacity(); }
  [[nodiscard]] RingCounters counters() const noexcept { return ring_.counters(); }

 private:
  ByteRing ring_;
};

/// The I/O thread's end: cuts reads into chunks and pushes them. A full ring costs the record, never time;
/// the gap in the sequence tells the capture's reader what is missing. Thread: the I/O thread of the ring
/// only. Waits: never. Allocates: never.
class RawTap {
 public:
  explicit RawTap(RawRing& ring) noexcept : ring_(&ring) {}

  /// @param device < kMaxDevices
  void record(DeviceIndex device, Direction direction, std::span<const std::uint8_t> bytes,
              HostTime arrival) noexcept {
    IMUSCOPE_EXPECTS(device < kMaxDevices);
    while (!bytes.empty()) {
      const auto piece = bytes.first(std::min(bytes.size(), kRawChunkBytes));
      bytes = bytes.subspan(piece.size());
      // The ring counts what it refuses.
      (void)ring_->try_push({{sequences_[device]++, arrival, device, direction, !bytes.empty()}, piece});
      if (direction == Direction::kStampedRead)
        direction = Direction::kRead;  // the stamp went with the first
    }
  }

 private:
  RawRing* ring_;
  std::array<std::int64_t, kMaxDevices> sequences_{};
};

}  // namespace imuscope
