#include "estimation/calibration/fixed_lag.h"

#include <algorithm>
#include <utility>

namespace imuscope {

FixedLagSmoother::FixedLagSmoother(std::vector<SImuLayout> layouts, std::size_t states)
    : layouts_(std::move(layouts)), states_(states) {}

void FixedLagSmoother::add(std::span<const double> record,
                           const std::function<void(const SmoothedEpoch&)>& give) {
  window_.emplace_back(states_, layouts_.size()).unpack(record);
  const HostTime newest = window_.back().state.time;
  if (window_.size() == 1) next_ = newest + kLag + kEvery;
  if (newest < next_) return;
  next_ = newest + kEvery;
  smooth(give);
}

// E-16
void FixedLagSmoother::smooth(const std::function<void(const SmoothedEpoch&)>& give) {
  const HostTime final_before = window_.back().state.time - kLag;
  const auto first_kept = std::find_if(window_.begin(), window_.end(), [final_before](const auto& epoch) {
    return epoch.state.time > final_before;
  });
  const auto n_given = static_cast<std::size_t>(first_kept - window_.begin());
  std::vector<SmoothedEpoch> smoothed;
  Eigen::VectorXd d;
  Eigen::MatrixXd P;
  for (std::size_t k = window_.size(); k-- > 0;) {
    if (k + 1 == window_.size()) {
      history::begin_back(window_[k], d, P);
    } else {
      smooth_back(history::step_from(window_[k], window_[k + 1]), d, P);
    }
    if (k < n_given) smoothed.push_back(history::smoothed_epoch(window_[k], d, P, layouts_));
  }
  for (auto epoch = smoothed.rbegin(); epoch != smoothed.rend(); ++epoch) give(*epoch);
  window_.erase(window_.begin(), first_kept);
}

}  // namespace imuscope
