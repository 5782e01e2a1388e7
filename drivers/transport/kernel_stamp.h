#pragma once

/// From the kernel's receive stamps to the host's time scale. The kernel stamps a frame with CLOCK_REALTIME,
/// which people and NTP may step; an interface that has a clock of its own stamps more finely, on that clock.

#include <cstdint>

#include "base/time.h"
#include "sample/clock_map.h"

namespace imuscope {

/// What the kernel said of one frame; 0 where it said nothing.
struct KernelStamps {
  std::int64_t software_ns = 0;  ///< CLOCK_REALTIME
  std::int64_t hardware_ns = 0;  ///< the interface's own clock
};

/// Core: no allocation after construction. One map a socket.
class KernelStampMap {
 public:
  /// Call before the stamps of each read are mapped, with both clocks as they are now.
  void begin_read(UtcTime wall_now, HostTime host_now) noexcept;

  /// Receive time of a frame of this read: never after the read, never before the frame before. By the
  /// interface's clock where it has one (fitted to the kernel's stamps, whose delay is never negative), by
  /// the kernel's otherwise, and by the read itself where there is neither, or where the wall clock was
  /// stepped since the last read.
  [[nodiscard]] HostTime map(const KernelStamps& stamps) noexcept;

  /// Frames that the interface itself stamped.
  [[nodiscard]] std::uint64_t hardware_stamps() const noexcept { return hardware_stamps_; }
  /// Steps of the wall clock.
  [[nodiscard]] std::uint64_t clock_steps() const noexcept { return clock_steps_; }

 private:
  [[nodiscard]] HostTime software_time(std::int64_t software_ns) const noexcept;

  bool has_offset_ = false;
  bool stepped_ = false;
  Duration wall_minus_host_{};
  HostTime read_{};
  HostTime last_{HostTime::min()};
  ClockMap hardware_;
  std::uint64_t hardware_stamps_ = 0;
  std::uint64_t clock_steps_ = 0;
};

}  // namespace imuscope
