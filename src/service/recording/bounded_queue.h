#pragma once

/// A queue from one thread to another that neither may run far ahead of. Non-real-time: a lock, allocates.

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <mutex>
#include <optional>
#include <utility>

namespace imuscope {

template <typename T>
class BoundedQueue {
 public:
  /// @param capacity  how many wait at most
  explicit BoundedQueue(std::size_t capacity) : capacity_(capacity) {}

  /// Waits for room. Thread: the one that makes them.
  /// @return false where nobody wants more
  bool push(T&& item) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return unwanted_ || ready_.size() < capacity_; });
    if (unwanted_) return false;
    ready_.push_back(std::move(item));
    lock.unlock();
    changed_.notify_all();
    return true;
  }
  /// No more is coming. Thread: the one that makes them.
  void end() {
    const std::lock_guard lock(mutex_);
    ended_ = true;
    changed_.notify_all();
  }

  /// Waits for the next; nothing at the end. Thread: the one that takes them.
  [[nodiscard]] std::optional<T> pop() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return ended_ || !ready_.empty(); });
    if (ready_.empty()) return std::nullopt;
    T item = std::move(ready_.front());
    ready_.pop_front();
    lock.unlock();
    changed_.notify_all();
    return item;
  }
  /// Waits for nothing. Thread: the one that takes them.
  [[nodiscard]] std::optional<T> pop_if_ready() {
    const std::lock_guard lock(mutex_);
    if (ready_.empty()) return std::nullopt;
    std::optional<T> item(std::move(ready_.front()));
    ready_.pop_front();
    changed_.notify_all();
    return item;
  }
  /// Nobody wants more: push() waits no longer. Thread: the one that takes them.
  void refuse() {
    const std::lock_guard lock(mutex_);
    unwanted_ = true;
    changed_.notify_all();
  }

 private:
  std::size_t capacity_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<T> ready_;
  bool ended_ = false;
  bool unwanted_ = false;
};

}  // namespace imuscope
