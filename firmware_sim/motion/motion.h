#pragma once

/// The vehicle's motion: where it is, how fast it turns and what its accelerometers would feel, at any
/// instant. Position, velocity, acceleration, attitude, rate and angular acceleration are exact derivatives
/// of one another (C4 splines through 20 Hz nodes, differentiated analytically); specific force follows from
/// them with Earth rate, transport rate and normal gravity.
///
/// Where the engine runs, its vibration adds to rate, angular acceleration and specific force alone: it moves
/// nothing by more than a hundredth of a millimetre.
///
/// Frames: n = north-east-down at the vehicle, b = forward-right-down at the R-IMU's origin, i = inertial.

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "firmware_sim/motion/drive.h"
#include "firmware_sim/motion/earth.h"
#include "firmware_sim/motion/engine.h"
#include "firmware_sim/motion/quintic_spline.h"

namespace imusim {

/// Everything about b at one instant.
struct MotionState {
  double t_s;
  GeodeticPosition position;
  Eigen::Vector3d v_n_mps;  ///< relative to the Earth
  double roll_rad;
  double pitch_rad;
  double heading_rad;  ///< continuous, not wrapped
  Eigen::Matrix3d C_b_n;
  Eigen::Vector3d omega_nb_b_radps;
  Eigen::Vector3d omega_ib_b_radps;
  Eigen::Vector3d omega_dot_ib_b_radps2;  ///< time derivative of omega_ib_b's components
  Eigen::Vector3d f_b_mps2;               ///< specific force: at rest, minus gravity
};

/// The vehicle's regime, which the sensors' noise depends on.
enum class Regime { kStatic, kDynamic };

class Motion {
 public:
  explicit Motion(const Scenario& scenario);

  /// Valid for any time; before 0 and after duration_s() the vehicle stands.
  [[nodiscard]] MotionState state_at(double t_s) const;

  /// Static wherever the vehicle stands, at a light as well as at the end.
  [[nodiscard]] Regime regime_at(double t_s) const;

  [[nodiscard]] double duration_s() const { return scenario_.duration_s; }
  [[nodiscard]] const Scenario& scenario() const { return scenario_; }

  /// Null where no engine runs.
  [[nodiscard]] const Engine* engine() const { return engine_ ? &*engine_ : nullptr; }

 private:
  Motion(const Scenario& scenario, const DriveNodes& nodes);

  [[nodiscard]] MotionState undisturbed_at(double t_s) const;

  Scenario scenario_;
  QuinticSpline latitude_offset_;
  QuinticSpline longitude_offset_;
  QuinticSpline height_;
  QuinticSpline roll_;
  QuinticSpline pitch_;
  QuinticSpline heading_;
  std::vector<MovingSpan> moving_;
  std::optional<Engine> engine_;
  std::optional<Vibration> vibration_;  ///< of the body, at b's origin
};

/// Rotation from b to n of roll, pitch and heading (z-y-x).
Eigen::Matrix3d C_b_n_from_euler(double roll_rad, double pitch_rad, double heading_rad);

/// Specific force at a point fixed to the vehicle, resolved in b.
/// @param r_b_m  from b's origin to the point
Eigen::Vector3d specific_force_at(const MotionState& state, const Eigen::Vector3d& r_b_m);

/// Position of a point fixed to the vehicle.
GeodeticPosition position_at(const MotionState& state, const Eigen::Vector3d& r_b_m);

/// Velocity relative to the Earth of a point fixed to the vehicle, in n.
Eigen::Vector3d velocity_at(const MotionState& state, const Eigen::Vector3d& r_b_m);

}  // namespace imusim
