#pragma once

/// From the kernel's receive stamps to the host's time scale. The kernel stamps a frame with CLOCK_REALTIME,
/// which people and NTP may step; an interface that has a clock of its own stamps more finely, on that clock.
///
/// An interface stamps where it was told to, which is a setting of the card that its users share (ptp4l makes
/// it; so does `hwstamp_ctl -i eth0 -r 1`): imuscope takes such stamps and changes no card.

#include <sys/socket.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "base/time.h"
#include "drivers/transport/transport.h"
#include "sample/clock_map.h"

namespace imuscope {

/// What the kernel said of one frame; 0 where it said nothing.
struct KernelStamps {
  std::int64_t software_ns = 0;  ///< CLOCK_REALTIME
  std::int64_t hardware_ns = 0;  ///< the interface's own clock
  std::uint32_t interface = 0;   ///< whose clock that is, where the kernel says so
};

/// Room for what the kernel says of one message beside its bytes: stamps, their interface, a count of drops.
inline constexpr std::size_t kStampControlBytes = 128;

/// Asks the kernel to stamp what a socket receives, and a card that stamps to say so.
/// @return false where it refuses: reads are stamped then
bool ask_for_stamps(int fd) noexcept;

/// What the kernel said of a message that recvmsg() brought. Core: no allocation.
[[nodiscard]] KernelStamps stamps_of(const msghdr& message) noexcept;

/// Both clocks of this PC at one moment.
struct BothClocks {
  HostTime host{};
  UtcTime wall{};
  Duration
      apart{};  ///< from the reading of `host` before that of `wall` to the one after, `host` in the middle
};
/// The best of a few tries. Core: no allocation.
[[nodiscard]] BothClocks read_both_clocks() noexcept;

/// Core: no allocation after construction. One map per socket.
class KernelStampMap {
 public:
  /// Call before the stamps of each read are mapped, with both clocks as they are now.
  void begin_read(UtcTime wall_now, HostTime host_now) noexcept;
  /// What is not known of the clocks makes a stamp late, never early.
  void begin_read(const BothClocks& now) noexcept { begin_read(now.wall, now.host + now.apart / 2); }

  /// Receive time of a frame of this read: never after the read, never before the frame before. By the
  /// interface's clock where it has one (fitted to the kernel's stamps, whose delay is never negative), by
  /// the kernel's otherwise, and by the read itself where there is neither, or where the wall clock was
  /// stepped after the frame had come.
  [[nodiscard]] HostTime map(const KernelStamps& stamps) noexcept;

  /// Frames that the interface itself stamped.
  [[nodiscard]] std::uint64_t hardware_stamps() const noexcept { return hardware_stamps_; }
  /// Steps of the wall clock.
  [[nodiscard]] std::uint64_t clock_steps() const noexcept { return clock_steps_; }

  /// By whom the newest frames were stamped, and how long they waited for their read, which is what a stamp
  /// of the read would be late by. Means over some hundred frames.
  [[nodiscard]] StampQuality quality() const noexcept {
    return {by_, lead_mean_s_, std::sqrt(std::max(lead_variance_s2_, 0.0))};
  }

 private:
  [[nodiscard]] HostTime software_time(std::int64_t software_ns) const noexcept;

  bool has_offset_ = false;
  HostTime trusted_from_{
      HostTime::min()};  ///< what came before was stamped by a wall clock that was stepped since
  Duration wall_minus_host_{};
  HostTime read_{};
  HostTime last_{HostTime::min()};
  ClockMap hardware_;
  std::uint64_t hardware_stamps_ = 0;
  std::uint64_t clock_steps_ = 0;
  std::uint32_t interface_ = 0;  ///< whose clock hardware_ follows
  StampedBy by_ = StampedBy::kRead;
  double lead_mean_s_ = 0.0;
  double lead_variance_s2_ = 0.0;
  std::uint64_t leads_ = 0;
};

}  // namespace imuscope
