#pragma once

/// The bounded queue by which data leaves a thread: one producer, one consumer, never a wait.

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>
#include <vector>

#include "base/contracts.h"

namespace imuscope {

/// Bytes that two cores cannot write at once without disturbing each other (x86-64 and most ARMv8).
inline constexpr std::size_t kCacheLineBytes = 64;

/// What a ring says about itself. Counts since construction.
struct RingCounters {
  std::uint64_t pushed = 0;      ///< elements accepted
  std::uint64_t refused = 0;     ///< elements that found the ring full and were not taken
  std::uint64_t level = 0;       ///< elements waiting now (a moment ago, seen from a third thread)
  std::uint64_t high_water = 0;  ///< most elements that ever waited together
};

/// Slots of a ring: inside it, or on the heap where their number follows from a configuration.
template <typename T, std::size_t Capacity>
class RingSlots {
 public:
  static constexpr std::size_t size() noexcept { return Capacity; }
  [[nodiscard]] T& operator[](std::uint64_t index) noexcept { return slots_[index & (Capacity - 1)]; }

 private:
  static_assert(std::has_single_bit(Capacity),
                "the capacity is a power of two, so that masking finds a slot");
  std::array<T, Capacity> slots_{};
};
template <typename T>
class RingSlots<T, std::dynamic_extent> {
 public:
  explicit RingSlots(std::size_t capacity) : slots_(capacity), mask_(capacity - 1) {
    IMUSCOPE_EXPECTS(std::has_single_bit(capacity));
  }
  [[nodiscard]] std::size_t size() const noexcept { return slots_.size(); }
  [[nodiscard]] T& operator[](std::uint64_t index) noexcept { return slots_[index & mask_]; }

 private:
  std::vector<T> slots_;
  std::uint64_t mask_;
};

/// Single-producer single-consumer ring of fixed capacity. A full ring refuses the newest element and counts
/// it: what was accepted is never overwritten, so order and sequence stay whole and a loss is one number.
///
/// Threads: exactly one calls try_push(), exactly one calls front(), pop() and try_pop(); counters() is for
/// any thread. Waits: never. Allocates: in the constructor at most (storage is touched by it, so that no page
/// is faulted in later; a large ring belongs on the heap, made before the threads start).
///
/// @tparam T         trivially copyable: a copy is bytes, cannot throw and owns nothing
/// @tparam Capacity  a power of two; all of it is usable. Choose it from time: rate x longest stall. Or
///                   std::dynamic_extent: the constructor is told.
///
/// How it works: both indices run freely and are masked on access, so full (difference = Capacity) and empty
/// (difference = 0) need no spare slot; at 64 bits they do not wrap in the life of a machine. Each side keeps
/// its index and its stale copy of the other's index on a cache line of its own, and looks at the other's
/// line only when the copy no longer lets it proceed.
template <typename T, std::size_t Capacity>
class SpscRing {
  static_assert(std::is_trivially_copyable_v<T>, "elements cross threads as bytes");

 public:
  SpscRing() = default;
  /// Of a ring whose capacity is no part of its type.
  explicit SpscRing(std::size_t capacity) : slots_(capacity) {}
  SpscRing(const SpscRing&) = delete;
  SpscRing& operator=(const SpscRing&) = delete;

  [[nodiscard]] constexpr std::size_t capacity() const noexcept { return slots_.size(); }

  /// Adds one element. Returns false when full; the loss is counted here. Thread: producer only.
  [[nodiscard]] bool try_push(const T& value) noexcept {
    // relaxed: the producer is the only writer of write, of the mark and of the refusals.
    const std::uint64_t write = producer_.write.load(std::memory_order_relaxed);
    const std::uint64_t mark = producer_.high_water.load(std::memory_order_relaxed);
    // The cached read index lags, so this level is never too low: where it stays at or below the mark (which
    // is at most Capacity), there is room and the mark holds, and the consumer's cache line is left alone.
    if (write + 1 - producer_.cached_read > mark) {
      // acquire: pairs with the release in pop(); the consumer is done with the slot written below.
      producer_.cached_read = consumer_.read.load(std::memory_order_acquire);
      const std::uint64_t level = write + 1 - producer_.cached_read;
      if (level > capacity()) {
        const std::uint64_t refused = producer_.refused.load(std::memory_order_relaxed);
        producer_.refused.store(refused + 1, std::memory_order_relaxed);
        return false;
      }
      if (level > mark) producer_.high_water.store(level, std::memory_order_relaxed);
    }
    slots_[write] = value;
    // release: the slot is complete before the index shows it; pairs with the acquire in front().
    producer_.write.store(write + 1, std::memory_order_release);
    return true;
  }

  /// The oldest element, or nullptr when the ring is empty. It stays valid and unchanged until pop().
  /// Thread: consumer only.
  [[nodiscard]] const T* front() noexcept {
    // relaxed: the consumer is the only writer of read.
    const std::uint64_t read = consumer_.read.load(std::memory_order_relaxed);
    if (read == consumer_.cached_write) {
      // acquire: pairs with the release in try_push(); the slot's content is visible.
      consumer_.cached_write = producer_.write.load(std::memory_order_acquire);
      if (read == consumer_.cached_write) return nullptr;
    }
    return &slots_[read];
  }

  /// Removes the element that front() returned. Thread: consumer only.
  void pop() noexcept {
    const std::uint64_t read = consumer_.read.load(std::memory_order_relaxed);
    IMUSCOPE_EXPECTS(read != consumer_.cached_write);
    // release: reading the slot is over before the producer may write it; pairs with the acquire in
    // try_push().
    consumer_.read.store(read + 1, std::memory_order_release);
  }

  /// front() and pop() in one. Returns false when empty. Thread: consumer only.
  [[nodiscard]] bool try_pop(T& value) noexcept {
    const T* oldest = front();
    if (oldest == nullptr) return false;
    value = *oldest;
    pop();
    return true;
  }

  /// For status and tests, any thread. Each number is right for some moment of the call; together they need
  /// not belong to the same one.
  [[nodiscard]] RingCounters counters() const noexcept {
    RingCounters counters;
    // acquire, and read before write: the write index seen is not older than the read index seen, so the
    // level is never negative. It may exceed Capacity by what was moved between the two loads: clamped.
    const std::uint64_t read = consumer_.read.load(std::memory_order_acquire);
    counters.pushed = producer_.write.load(std::memory_order_acquire);
    counters.level = std::min<std::uint64_t>(counters.pushed - read, capacity());
    counters.refused = producer_.refused.load(std::memory_order_relaxed);
    counters.high_water = producer_.high_water.load(std::memory_order_relaxed);
    return counters;
  }

 private:
  struct alignas(kCacheLineBytes) Producer {
    std::atomic<std::uint64_t> write{0};
    std::atomic<std::uint64_t> refused{0};
    std::atomic<std::uint64_t> high_water{0};
    std::uint64_t cached_read = 0;
  };
  struct alignas(kCacheLineBytes) Consumer {
    std::atomic<std::uint64_t> read{0};
    std::uint64_t cached_write = 0;
  };

  Producer producer_;
  Consumer consumer_;
  alignas(kCacheLineBytes) RingSlots<T, Capacity> slots_;
};

}  // namespace imuscope
