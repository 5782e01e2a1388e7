#pragma once

/// Waits for bytes on lines until an instant. Core: no allocation, no lock; never spins, whatever the
/// kernel answers.

#include <sys/epoll.h>
#include <span>

#include "base/result.h"
#include "base/time.h"

namespace imuscope {

/// Thread: open() before the loop, the rest from its thread alone.
class LineEvents {
 public:
  LineEvents() = default;
  ~LineEvents();
  LineEvents(const LineEvents&) = delete;
  LineEvents& operator=(const LineEvents&) = delete;

  /// Where the kernel knows no epoll_pwait2 (before Linux 5.11) or a container's rules refuse it, a timer
  /// takes its place.
  [[nodiscard]] Result<void> open();

  [[nodiscard]] int epoll() const noexcept { return epoll_; }

  /// @return how many of `events` are filled: bytes wait, or a line vanished; 0 at `until` and after a signal
  [[nodiscard]] int wait(std::span<epoll_event> events, HostTime until) noexcept;

 private:
  [[nodiscard]] int wait_with_timer(std::span<epoll_event> events, HostTime until) noexcept;

  int epoll_ = -1;
  int timer_ = -1;  ///< -1 where the kernel waits to the nanosecond by itself
};

}  // namespace imuscope
