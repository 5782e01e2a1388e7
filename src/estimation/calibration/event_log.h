#pragma once

/// The events of one tick, in fixed memory.

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <utility>

#include "base/limits.h"
#include "estimation/calibration/events.h"

namespace imuscope {

class EventLog {
 public:
  static constexpr std::size_t kCapacity = kEventsPerTick;

  void add(const EventPayload& what, DeviceIndex device, HostTime time) noexcept {
    if (size_ == kCapacity) {
      ++lost_;
      return;
    }
    events_[size_++] = {what, device, time};
  }
  [[nodiscard]] std::span<const EstimatorEvent> events() const noexcept { return {events_.data(), size_}; }
  [[nodiscard]] std::uint64_t lost() const noexcept { return lost_; }
  /// Takes over what `other` holds, and no more of its memory than that; other is empty afterwards.
  void take(EventLog& other) noexcept {
    std::copy_n(other.events_.begin(), other.size_, events_.begin());
    size_ = std::exchange(other.size_, 0);
  }

 private:
  std::array<EstimatorEvent, kCapacity> events_{};
  std::size_t size_ = 0;
  std::uint64_t lost_ = 0;
};

}  // namespace imuscope
