#pragma once

/// How much the vehicle moves, in cells of a tenth of a second: rate, force, vibration and speed, as the
/// reference and the navigation show them. What static and dynamic, and bins of intensity, are found from.

#include <cstdint>
#include <optional>
#include <vector>

#include "base/time.h"
#include "sample/sample.h"

namespace imuscope {

/// One cell. Without samples (n = 0) nothing is known of it.
struct MotionCell {
  std::size_t n = 0;
  Vector3 omega_radps{};            ///< mean
  Vector3 f_mps2{};                 ///< mean
  double vibration_mps2 = 0.0;      ///< rms of the force about its mean in the cell, all axes together
  double rate_rms_radps = 0.0;      ///< of the magnitude
  double rate_scatter_radps = 0.0;  ///< rms of the rate about its mean in the cell, all axes together
  std::optional<double> speed_mps;  ///< magnitude; held until the next one, for at most kSpeedHeld_s
  double speed_sd_mps = 0.0;
};

/// Collects samples, in any order. Thread: one. Allocates with the length of the run, kLongestRun_s at most.
class MotionLevels {
 public:
  static constexpr double kCell_s = 0.1;
  static constexpr double kSpeedHeld_s = 1.0;
  /// Between the first cell and the last; samples beyond it, which no drive has and a forged time may, are
  /// left out.
  static constexpr double kLongestRun_s = 4.0 * 86'400.0;

  /// The reference, compensated with its biases, at one instant.
  void add(HostTime time, const Vector3& omega_ib_b_radps, const Vector3& f_b_mps2);
  void add_speed(HostTime time, double speed_mps, double sd_mps);

  /// Gives up the cells that end before `time`, and their memory.
  void forget_before(HostTime time);

  /// Cells of the whole run, without a hole; empty before the first sample.
  [[nodiscard]] std::vector<MotionCell> cells() const;
  /// Beginning of cell `index`.
  [[nodiscard]] HostTime begin_of(std::size_t index) const;

 private:
  struct Sums {
    std::size_t n = 0;
    Vector3 mean_omega{};
    Vector3 mean_f{};
    double omega_squares = 0.0;
    double omega_deviation_squares = 0.0;
    double f_deviation_squares = 0.0;
    std::optional<double> speed_mps;
    double speed_sd_mps = 0.0;
  };
  Sums* at(HostTime time);

  std::optional<std::int64_t> first_;  ///< number of the first cell since the time scale's origin
  std::vector<Sums> sums_;
};

}  // namespace imuscope
