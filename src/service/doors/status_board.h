#pragma once

/// The newest status of a run, for the doors through which this PC may ask for it.

#include <imuscope/status_t.hpp>
#include <memory>
#include <mutex>
#include <utility>

#include "base/time.h"

namespace imuscope {

/// Threads: any non-real-time one. Nobody waits for a reader: what was read stays whole, whatever is put up
/// after.
class StatusBoard {
 public:
  struct Posted {
    status_t status;
    HostTime at{};
  };

  /// @param at  when it was made
  void put(status_t status, HostTime at) {
    auto fresh = std::make_shared<const Posted>(Posted{std::move(status), at});
    const std::lock_guard lock(mutex_);
    newest_ = std::move(fresh);
  }
  /// Null before the first.
  [[nodiscard]] std::shared_ptr<const Posted> newest() const {
    const std::lock_guard lock(mutex_);
    return newest_;
  }

 private:
  mutable std::mutex mutex_;
  std::shared_ptr<const Posted> newest_;
};

}  // namespace imuscope
