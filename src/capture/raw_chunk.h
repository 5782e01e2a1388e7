#pragma once

/// How the bytes of a read travel from an I/O thread to the recorder.

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>

#include "base/contracts.h"
#include "base/limits.h"
#include "base/time.h"
#include "rt/spsc_ring.h"
#include "sample/sample.h"

namespace imuscope {

enum class Direction : std::uint8_t { kRead, kWrite };

inline constexpr std::size_t kRawChunkBytes = 1024;

/// A read from, or a write to, a device, or a part of one that is larger than a chunk.
struct RawChunk {
  std::int64_t sequence;  ///< counts the chunks of the device, from 0, refused ones included
  HostTime arrival;       ///< of the read or write
  DeviceIndex device;
  Direction direction;
  bool continues;  ///< the next chunk of this device holds more of the same read or write
  std::uint16_t n_bytes;
  std::array<std::uint8_t, kRawChunkBytes> bytes;
};
static_assert(std::is_trivially_copyable_v<RawChunk>);

/// From one I/O thread to the recorder; 2.1 MB.
using RawRing = SpscRing<RawChunk, kRawRingCapacity>;

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
      const std::size_t n = std::min(bytes.size(), kRawChunkBytes);
      chunk_.sequence = sequences_[device]++;
      chunk_.arrival = arrival;
      chunk_.device = device;
      chunk_.direction = direction;
      chunk_.continues = n < bytes.size();
      chunk_.n_bytes = static_cast<std::uint16_t>(n);
      std::memcpy(chunk_.bytes.data(), bytes.data(), n);
      (void)ring_->try_push(chunk_);  // the ring counts what it refuses
      bytes = bytes.subspan(n);
    }
  }

 private:
  RawRing* ring_;
  RawChunk chunk_{};
  std::array<std::int64_t, kMaxDevices> sequences_{};
};

}  // namespace imuscope
