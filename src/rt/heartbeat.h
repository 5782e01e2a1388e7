#pragma once

/// When a thread last went round its loop, for whoever watches over it.

#include <atomic>
#include <cstdint>

#include "base/time.h"

namespace imuscope {

/// Threads: beat() from the one that is watched, last() from any. Core: no lock, no allocation.
class Heartbeat {
 public:
  /// @param begin  stands for the first beat, until it comes
  explicit Heartbeat(HostTime begin) noexcept : last_ns_(to_ns(begin)) {}

  void beat(HostTime now) noexcept { last_ns_.store(to_ns(now), std::memory_order_relaxed); }
  [[nodiscard]] HostTime last() const noexcept {
    return host_time_from_ns(last_ns_.load(std::memory_order_relaxed));
  }

 private:
  std::atomic<std::int64_t> last_ns_;
  static_assert(std::atomic<std::int64_t>::is_always_lock_free);
};

}  // namespace imuscope
