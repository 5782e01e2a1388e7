#pragma once

/// Tells standing from moving, so that R can be chosen per regime. Smoothed rate and force of the reference
/// are watched for their spread about a slow mean. Where there are wheels, they decide too: turning wheels
/// are motion at once, however smooth the road; with standing wheels, people and the engine may shake the
/// vehicle somewhat. Wheels at zero alone are no proof of rest, as their sensors are blind to a slow creep.
/// Core. Thread: one.

#include <Eigen/Core>

#include "base/units.h"
#include "estimation/calibration/estimator_config.h"

namespace imuscope {

class RegimeDetector {
 public:
  /// One R sample; dt since the one before.
  void add(const Eigen::Vector3d& omega_radps, const Eigen::Vector3d& f_mps2, double dt_s) noexcept;
  /// What the wheels show; valid until it is half a second old.
  void add_wheel_speed(double speed_mps) noexcept;
  [[nodiscard]] Regime regime() const noexcept { return regime_; }
  /// Force averaged over some seconds; meaningful while static.
  [[nodiscard]] const Eigen::Vector3d& mean_f_mps2() const noexcept { return mean_f_; }

 private:
  // The smoothing takes engine vibration out; what a vehicle does while moving stays.
  static constexpr double kSmoothing_s = 0.2;
  static constexpr double kMean_s = 3.0;
  static constexpr double kSpread_s = 1.0;
  static constexpr double kRateLimit_radps = 0.25 * kRadPerDeg;
  static constexpr double kForceLimit_mps2 = 0.08;
  static constexpr double kWheelsValid_s = 0.5;
  static constexpr double kWheelsStand_mps = 0.05;
  static constexpr double kShaking = 3.0;  ///< factor on the limits while the wheels stand
  static constexpr double kHold_s = 1.0;   ///< quiet for so long before it counts as standing

  Regime regime_ = Regime::kDynamic;
  bool started_ = false;
  Eigen::Vector3d omega_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d f_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_omega_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_f_ = Eigen::Vector3d::Zero();
  double omega_variance_ = 0.0;
  double f_variance_ = 0.0;
  double quiet_s_ = 0.0;
  double wheels_age_s_ = kWheelsValid_s;
  double wheels_stood_s_ = 0.0;
  bool wheels_stand_ = false;
};

}  // namespace imuscope
