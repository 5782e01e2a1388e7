#pragma once

/// The temperature of one S-IMU over a run, as its own messages told it: second by second. Devices send it
/// with every sample, now and then, or not at all.

#include <map>
#include <optional>

#include "base/time.h"

namespace imuscope {

/// Thread: one. Allocates with the length of the run.
class TemperatureTrack {
 public:
  void add(HostTime time, double temperature_degC);
  [[nodiscard]] bool empty() const noexcept { return cells_.empty(); }
  /// Of the readings from `begin` to `end`; absent where there are none.
  [[nodiscard]] std::optional<double> mean(HostTime begin, HostTime end) const;

 private:
  struct Cell {
    double sum = 0.0;
    double n = 0.0;
  };
  std::map<std::int64_t, Cell> cells_;  ///< by whole seconds of the time scale
};

}  // namespace imuscope
