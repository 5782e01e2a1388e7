#pragma once

/// A line a minute for the person in the car: how fast, how well each mounting is known, how well the
/// position.

#include <optional>
#include <string>

#include "configuration/config.h"
#include "service/pipeline/core.h"

namespace imuscope {

class MinuteLine {
 public:
  /// @param configuration  outlives this
  explicit MinuteLine(const Configuration& configuration) : configuration_(configuration) {}

  /// Once for every full minute of the run: "3 min: 43 km/h, position 0.02 m; mtx1 boresight 0.012 deg, lever
  /// arm 1.3 mm, time 0.12 ms; mtx2 looking for its mounting". The numbers are the largest sd of each.
  /// Nothing in between.
  std::optional<std::string> look(const Snapshot& snapshot);

 private:
  const Configuration& configuration_;
  std::int64_t told_ = 0;  ///< minutes
};

}  // namespace imuscope
