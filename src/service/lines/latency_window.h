#pragma once

/// How late the samples of one device come, for the status. One thread adds and asks; nothing is allocated.

#include <chrono>
#include <limits>

#include "base/time.h"

namespace imuscope {

/// Mean over the last whole second.
class LatencyWindow {
 public:
  void add(HostTime arrival, Duration latency) noexcept {
    if (arrival - begin_ >= std::chrono::seconds(1)) {
      if (n_ > 0.0) closed_mean_s_ = sum_s_ / n_;
      begin_ = arrival;
      n_ = sum_s_ = 0.0;
    }
    sum_s_ += to_seconds(latency);
    n_ += 1.0;
  }
  /// NaN before the first second is over.
  [[nodiscard]] double mean_s() const noexcept { return closed_mean_s_; }

 private:
  HostTime begin_{};
  double n_ = 0.0;
  double sum_s_ = 0.0;
  double closed_mean_s_ = std::numeric_limits<double>::quiet_NaN();
};

}  // namespace imuscope
