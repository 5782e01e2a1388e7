#pragma once

/// What the wheels of the simulated vehicle show. The vehicle does not slip sideways at b's origin (its path
/// is tangent to its heading there), so the axle that does not steer stands under it.

#include <Eigen/Core>
#include <cstdint>
#include <string_view>

#include "firmware_sim/imu/noise.h"
#include "firmware_sim/motion/motion.h"

namespace imusim {

struct WheelErrors {
  double scale = 0.0;         ///< relative; 0.01 shows 1 % too much (a worn tyre)
  double slow_sd_mps = 0.03;  ///< tyre and road, first-order Gauss-Markov
  double slow_tau_s = 0.5;
  double white_sd_mps = 0.01;    ///< of one reading
  double step_mps = 0.01 / 3.6;  ///< resolution of the signal
  double dead_band_mps = 0.3;    ///< slower wheels show zero
};

/// One wheel.
class WheelSpeed {
 public:
  /// @param motion   must outlive the wheel
  /// @param r_b_m    the wheel's centre, from b's origin; forward 0 where the path's tangent is
  /// @param name     with the seed, makes the errors reproducible
  WheelSpeed(const Motion& motion, const Eigen::Vector3d& r_b_m, const WheelErrors& errors,
             std::uint64_t seed, std::string_view name);

  /// Forward speed as shown at t_s, with its sign. Times must rise from call to call.
  double shown_at(double t_s);
  /// Without errors.
  [[nodiscard]] double true_at(double t_s) const;

 private:
  const Motion* motion_;
  Eigen::Vector3d r_b_m_;
  WheelErrors errors_;
  NoiseSource noise_;
  bool has_last_ = false;
  double last_t_s_ = 0.0;
};

}  // namespace imusim
