#pragma once

/// The bounded queue for records of any length: one producer, one consumer, never a wait.

#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "base/contracts.h"
#include "rt/spsc_ring.h"

namespace imuscope {

/// Single-producer single-consumer ring of bytes, in which a record takes as much room as it is long: it
/// lasts as long as its bytes, not as its longest record. A full ring refuses the newest record and counts
/// it, as SpscRing does.
///
/// Threads: exactly one calls try_push(), exactly one calls front() and pop(); counters() is for any thread.
/// Waits: never. Allocates: in the constructor alone, which touches every byte, so that no page is faulted in
/// later.
///
/// How it works: each record stands whole, after its length and at a multiple of kAlign, so that the consumer
/// reads it where it lies. One that the end of the storage would part begins at the start again, after a
/// mark that says so. Indices run freely, as those of SpscRing.
class ByteRing {
 public:
  /// @param capacity  bytes, a power of two; each record takes its own, rounded up to kAlign, and kAlign more
  explicit ByteRing(std::size_t capacity) : storage_(capacity) {
    IMUSCOPE_EXPECTS(std::has_single_bit(capacity) && capacity >= 2 * kAlign);
  }
  ByteRing(const ByteRing&) = delete;
  ByteRing& operator=(const ByteRing&) = delete;

  [[nodiscard]] std::size_t capacity() const noexcept { return storage_.size(); }

  /// Adds one record, `head` and `body` joined. Returns false when there is no room; the loss is counted
  /// here. Thread: producer only.
  [[nodiscard]] bool try_push(std::span<const std::uint8_t> head,
                              std::span<const std::uint8_t> body) noexcept {
    const std::size_t length = head.size() + body.size();
    const std::size_t needed = room_of(length);
    // relaxed: the producer is the only writer of write, of the mark and of the counts.
    const std::uint64_t write = producer_.write.load(std::memory_order_relaxed);
    const std::size_t to_end = storage_.size() - place_of(write);
    const std::size_t passed = needed <= to_end ? 0 : to_end;
    const std::uint64_t after = write + passed + needed;
    if (after - producer_.cached_read > storage_.size()) {
      // acquire: pairs with the release in pop(); the consumer is done with the bytes written below.
      producer_.cached_read = consumer_.read.load(std::memory_order_acquire);
      if (after - producer_.cached_read > storage_.size()) {
        add_one(producer_.refused);
        return false;
      }
    }
    // The index of the consumer lags in the cache: only where the mark would rise is the true one asked for.
    if (after - producer_.cached_read > producer_.high_water.load(std::memory_order_relaxed)) {
      producer_.cached_read = consumer_.read.load(std::memory_order_acquire);
      const std::uint64_t level = after - producer_.cached_read;
      if (level > producer_.high_water.load(std::memory_order_relaxed))
        producer_.high_water.store(level, std::memory_order_relaxed);
    }
    if (passed > 0) put_length(place_of(write), kPassed);
    const std::size_t place = place_of(write + passed);
    put_length(place, length);
    copy_to(place + kAlign, head);
    copy_to(place + kAlign + head.size(), body);
    add_one(producer_.pushed);
    // release: the record is complete before the index shows it; pairs with the acquire in front().
    producer_.write.store(after, std::memory_order_release);
    return true;
  }

  /// The oldest record, or nothing when the ring is empty; a record is never empty. It stays valid and
  /// unchanged until pop(). Thread: consumer only.
  [[nodiscard]] std::span<const std::uint8_t> front() noexcept {
    // relaxed: the consumer is the only writer of read.
    const std::uint64_t read = consumer_.read.load(std::memory_order_relaxed);
    if (read == consumer_.cached_write) {
      // acquire: pairs with the release in try_push(); the record's bytes are visible.
      consumer_.cached_write = producer_.write.load(std::memory_order_acquire);
      if (read == consumer_.cached_write) return {};
    }
    const std::size_t place = place_of(begin_of(read));
    return {storage_.data() + place + kAlign, length_at(place)};
  }

  /// Removes the record that front() returned. Thread: consumer only.
  void pop() noexcept {
    const std::uint64_t read = consumer_.read.load(std::memory_order_relaxed);
    IMUSCOPE_EXPECTS(read != consumer_.cached_write);
    const std::uint64_t begin = begin_of(read);
    // release: reading the record is over before the producer may write there; pairs with the acquire in
    // try_push().
    consumer_.read.store(begin + room_of(length_at(place_of(begin))), std::memory_order_release);
  }

  /// For status and tests, any thread: records pushed and refused, bytes waiting now and at most. As with
  /// SpscRing, the numbers need not belong to the same moment.
  [[nodiscard]] RingCounters counters() const noexcept {
    RingCounters counters;
    // acquire, and read before write: the level is never negative.
    const std::uint64_t read = consumer_.read.load(std::memory_order_acquire);
    const std::uint64_t level = producer_.write.load(std::memory_order_acquire) - read;
    counters.level = level < storage_.size() ? level : storage_.size();
    counters.pushed = producer_.pushed.load(std::memory_order_relaxed);
    counters.refused = producer_.refused.load(std::memory_order_relaxed);
    counters.high_water = producer_.high_water.load(std::memory_order_relaxed);
    return counters;
  }

 private:
  using Length = std::uint64_t;
  static constexpr std::size_t kAlign = sizeof(Length);
  /// In place of a length: the rest of the storage is passed over.
  static constexpr Length kPassed = ~Length{0};

  static constexpr std::size_t room_of(std::size_t length) noexcept {
    return kAlign + (length + kAlign - 1) / kAlign * kAlign;
  }
  [[nodiscard]] std::size_t place_of(std::uint64_t index) const noexcept {
    return static_cast<std::size_t>(index & (storage_.size() - 1));
  }
  [[nodiscard]] Length length_at(std::size_t place) const noexcept {
    Length length = 0;
    std::memcpy(&length, storage_.data() + place, sizeof length);
    return length;
  }
  void put_length(std::size_t place, Length length) noexcept {
    std::memcpy(storage_.data() + place, &length, sizeof length);
  }
  void copy_to(std::size_t place, std::span<const std::uint8_t> bytes) noexcept {
    if (!bytes.empty()) std::memcpy(storage_.data() + place, bytes.data(), bytes.size());
  }
  /// Where the record that the consumer finds at `read` begins.
  [[nodiscard]] std::uint64_t begin_of(std::uint64_t read) const noexcept {
    const std::size_t place = place_of(read);
    return length_at(place) == kPassed ? read + (storage_.size() - place) : read;
  }
  static void add_one(std::atomic<std::uint64_t>& count) noexcept {
    count.store(count.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
  }

  struct alignas(kCacheLineBytes) Producer {
    std::atomic<std::uint64_t> write{0};
    std::atomic<std::uint64_t> pushed{0};
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
  std::vector<std::uint8_t> storage_;
};

}  // namespace imuscope
