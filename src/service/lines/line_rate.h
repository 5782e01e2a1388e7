#pragma once

/// What a device brings to the recorder, at most: from its configuration alone.

#include <cstddef>
#include <span>

#include "configuration/config.h"

namespace imuscope {

struct LineRate {
  double bytes_per_s = 0.0;
  double reads_per_s = 0.0;
};

/// Of one device that has a line: what its samples take, and no more than its serial line can carry.
[[nodiscard]] LineRate line_rate(const DeviceConfig& device);

/// Bytes of the ring to the recorder that holds what these devices bring while the disk stands still for
/// kRecordStall_s (base/limits.h).
[[nodiscard]] std::size_t raw_ring_bytes(std::span<const DeviceConfig> devices);

}  // namespace imuscope
