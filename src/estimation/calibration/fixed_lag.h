#pragma once

/// Smoothing while a run goes on: the state of some seconds ago, with what was measured since. The window of
/// the newest epochs of the history is smoothed backwards every few seconds; what has left it is final.
/// EQUATIONS.md E-16. Non-real-time: allocates in the constructor and in smoothed().

#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include "estimation/calibration/history_record.h"
#include "estimation/calibration/smoother.h"

namespace imuscope {

/// Takes the filter's epochs and gives each back smoothed, five to ten seconds late. Thread: owner only.
class FixedLagSmoother {
 public:
  /// A state is given out when it is at least this old.
  static constexpr Duration kLag = std::chrono::seconds{5};
  /// The window is smoothed when the newest epoch is this much newer than at the last time: the longer, the
  /// less work, the later the result.
  static constexpr Duration kEvery = std::chrono::seconds{5};

  /// @param layouts  of the S-IMUs, in order
  /// @param states   dimension of the filter
  FixedLagSmoother(std::vector<SImuLayout> layouts, std::size_t states);

  /// Takes one epoch, packed (history::pack), in order of time. Epochs that have become old enough are handed
  /// to `give`, oldest first.
  void add(std::span<const double> record, const std::function<void(const SmoothedEpoch&)>& give);

 private:
  void smooth(const std::function<void(const SmoothedEpoch&)>& give);

  std::vector<SImuLayout> layouts_;
  std::size_t states_;
  std::vector<history::Filtered> window_;  ///< oldest first
  HostTime next_{HostTime::min()};
};

}  // namespace imuscope
