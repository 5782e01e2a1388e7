#pragma once

/// How long a datagram waited to be read, by the kernel's stamp of it. The kernel stamps by the wall clock,
/// which people and NTP may step while the datagram waits.

#include <algorithm>
#include <chrono>

namespace imuscope {

/// Thread: one. Deterministic: a function of the readings.
class ReceiveAge {
 public:
  using Time = std::chrono::nanoseconds;
  /// A wall clock that departed from the monotonic one by more than this was stepped. A step that is
  /// shorter than what the datagram waited cannot be told from waiting: the age is wrong by it at most.
  static constexpr Time kStepMin = std::chrono::milliseconds(2);

  /// One reading of both clocks, since their epochs.
  struct Clocks {
    Time monotonic{};
    Time wall{};
    [[nodiscard]] constexpr Time offset() const noexcept { return wall - monotonic; }
  };

  explicit ReceiveAge(const Clocks& now) noexcept : nothing_waited_(now) {}

  /// At this moment no datagram waited: all that is read from now on was received later.
  void nothing_waited(const Clocks& then) noexcept { nothing_waited_ = then; }

  /// @param received  the kernel's stamp
  /// @param now       read after the datagram was
  /// @return 0 where the stamp fits no moment since nothing waited
  [[nodiscard]] Time of(Time received, const Clocks& now) const noexcept {
    constexpr Time kNone{0};
    const Time longest = now.monotonic - nothing_waited_.monotonic + kStepMin;
    // Stamped after a step, or before it.
    for (const Time offset : {now.offset(), nothing_waited_.offset()}) {
      const Time age = now.monotonic - (received - offset);
      if (age >= -kStepMin && age <= longest) return std::max(kNone, age);
    }
    return kNone;
  }

 private:
  Clocks nothing_waited_;
};

}  // namespace imuscope
