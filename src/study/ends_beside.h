#pragma once

/// Ends what is no longer needed beside the work that goes on: a scratch file of some gigabytes is gone only when the
/// disk has taken what was on its way there, and who closes it waits for that.

#include <future>
#include <utility>
#include <vector>

#include "service/recording/side_by_side.h"

namespace imuscope {

class EndsBeside {
 public:
  /// At once where no second thread may be used. All have ended when this is gone.
  template <typename T>
  void end(T object) {
    if (!may_use_threads()) return;
    // The task itself lives as long as its future.
    ending_.push_back(std::async(std::launch::async, [held = std::move(object)]() mutable {
      [[maybe_unused]] const T ended = std::move(held);
    }));
  }

 private:
  std::vector<std::future<void>> ending_;
};

}  // namespace imuscope
