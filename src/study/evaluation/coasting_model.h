#pragma once

/// The stochastic model of one IMU as a navigation filter holds it: what is white within a filter's step, and
/// what has to be a state.

#include <array>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

namespace imuscope {

/// gyro x, y, z, accelerometer x, y, z of the sensor's own axes.
inline constexpr std::size_t kImuAxes = 6;

/// A Gauss-Markov process that is a state of the filter.
struct SlowProcess {
  double variance = 0.0;    ///< stationary, (rad/s)² or (m/s²)²
  double rate_per_s = 0.0;  ///< 1 / correlation time, above zero
};

/// Noise of one axis; u is its unit, rad/s for a gyro and m/s² for an accelerometer.
struct AxisNoise {
  double white_density = 0.0;     ///< u²/Hz: white noise, with every process too fast to be a state
  double walk_density = 0.0;      ///< u²/s: random walk of the bias
  double turn_on_variance = 0.0;  ///< u²: of the constant part of the bias, at the start
  std::vector<SlowProcess> slow;  ///< at most kSlowMax
};

inline constexpr std::size_t kSlowMax = 4;

struct CoastingModel {
  std::string name;    ///< "static", "dynamic", "by dynamics", "data sheet"
  std::string source;  ///< where its numbers come from, for people
  std::array<AxisNoise, kImuAxes> axes;
  /// White densities in force from `from_s` on, in order of time, where they change with the vehicle's
  /// motion. Empty: those of `axes` throughout.
  struct Change {
    double from_s = -std::numeric_limits<double>::infinity();
    std::array<double, kImuAxes> white_density{};
  };
  std::vector<Change> changes;
};

}  // namespace imuscope
