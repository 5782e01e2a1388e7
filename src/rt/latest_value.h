#pragma once

/// The cell by which a newest value (a noise model, a status) reaches another thread: older values are
/// replaced, not queued.

#include <array>
#include <atomic>
#include <cstdint>
#include <type_traits>

#include "rt/spsc_ring.h"

namespace imuscope {

/// Triple buffer: one writer, one reader. Three slots, one with each side and one in between; publishing and
/// taking are one atomic exchange of slot numbers. Neither side waits for the other, whatever its priority: a
/// writer that is preempted in the middle of write() holds only its own slot.
///
/// Threads: exactly one calls write(), exactly one calls take() and value(). Waits: never. Allocates: never.
/// @tparam T trivially copyable, default-constructible; value() is T{} until the first take() succeeds
template <typename T>
class LatestValue {
  static_assert(std::is_trivially_copyable_v<T>, "values cross threads as bytes");

 public:
  LatestValue() = default;
  LatestValue(const LatestValue&) = delete;
  LatestValue& operator=(const LatestValue&) = delete;

  /// Makes `value` the newest one. Thread: writer only.
  void write(const T& value) noexcept {
    slots_[back_].value = value;
    // release: the slot is complete before its number is offered; pairs with the acquire in take().
    // acquire: the slot that comes back was given up by take() with release, so its reader is done with it.
    const std::uint8_t previous = middle_.exchange(back_ | kFresh, std::memory_order_acq_rel);
    back_ = previous & kSlotMask;
  }

  /// Fetches the newest value if one was written since the last call. Returns whether value() changed.
  /// Thread: reader only.
  [[nodiscard]] bool take() noexcept {
    // relaxed: only a hint that an exchange is worth while; the exchange itself orders the memory.
    if ((middle_.load(std::memory_order_relaxed) & kFresh) == 0) return false;
    // acquire: pairs with the release in write(). release: hands our old slot back (see write()).
    const std::uint8_t fresh = middle_.exchange(front_, std::memory_order_acq_rel);
    front_ = fresh & kSlotMask;
    return true;
  }

  /// The value of the last successful take(). Thread: reader only.
  [[nodiscard]] const T& value() const noexcept { return slots_[front_].value; }

 private:
  static constexpr std::uint8_t kFresh = 4;
  static constexpr std::uint8_t kSlotMask = 3;

  struct alignas(kCacheLineBytes) Slot {
    T value{};
  };

  std::array<Slot, 3> slots_{};
  alignas(kCacheLineBytes) std::uint8_t back_ = 0;                // the writer's slot
  alignas(kCacheLineBytes) std::uint8_t front_ = 2;               // the reader's slot
  alignas(kCacheLineBytes) std::atomic<std::uint8_t> middle_{1};  // on offer, with kFresh when not yet taken
};

}  // namespace imuscope
