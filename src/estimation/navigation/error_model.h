#pragma once

/// Error dynamics of the navigation state: phi angles, metric NED position error, truth = estimate + error.
///
///   r = r^ + dr (metres along NED),  v = v^ + dv,  C_b_n = Exp(phi) C^_b_n,  b = b^ + db
///
/// so that every correction adds. Order of the 15 error states: dr, dv, phi, db_g, db_a. EQUATIONS.md N-20 to
/// N-26; exact first-order linearisation, gravity's change with latitude included. Core: no allocation.

#include "estimation/navigation/navigation_state.h"
#include "estimation/navigation/reference_grade.h"

namespace imuscope {

/// First index of each block of three in the navigation error state.
enum NavigationErrorBlock : int {
  kPositionError = 0,    ///< dr, NED, m
  kVelocityError = 3,    ///< dv, NED, m/s
  kAttitudeError = 6,    ///< phi, NED, rad
  kGyroBiasError = 9,    ///< db_g, b, rad/s
  kAccelBiasError = 12,  ///< db_a, b, m/s^2
};
inline constexpr int kNavigationErrorSize = 15;
/// Position, velocity and attitude: the rows of the dynamics that are not plain decay.
inline constexpr int kNavigationKinematicSize = 9;

using NavigationErrorVector = Eigen::Matrix<double, kNavigationErrorSize, 1>;
using NavigationErrorCovariance = Eigen::Matrix<double, kNavigationErrorSize, kNavigationErrorSize>;
using NavigationDynamics = Eigen::Matrix<double, kNavigationKinematicSize, kNavigationErrorSize>;
using NavigationMeasurementMatrix = Eigen::Matrix<double, 3, kNavigationErrorSize>;

/// A first-order Gauss-Markov bias: stationary sd and correlation time. An infinite correlation time means a
/// random constant.
struct BiasProcess {
  double sd = 0.0;                  ///< stationary, unit of the bias
  double correlation_time_s = 0.0;  ///< > 0
};

/// What drives the error state.
struct NavigationProcessNoise {
  double gyro_noise_radps_per_sqrt_hz = 0.0;  ///< white rate noise (angle random walk), rad/s/sqrt(Hz)
  double accel_noise_mps2_per_sqrt_hz = 0.0;  ///< white force noise (velocity random walk)
  BiasProcess gyro_bias;                      ///< per axis, rad/s
  BiasProcess accel_bias;                     ///< per axis, m/s^2
  /// N-27: what scale and axes make of a manoeuvre, intensity on each axis of b, (rad/s)^2/Hz and (m/s^2)^2/Hz.
  Eigen::Vector3d gyro_by_motion = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel_by_motion = Eigen::Vector3d::Zero();

  /// @param manoeuvre  compensated rates without vibration, which comes and goes too fast to leave anything
  void set_motion(const ReferenceGrade& grade, const NavigationState& state,
                  const InertialRates& manoeuvre) noexcept;
};

/// d(dr, dv, phi)/dt = F [dr, dv, phi, db_g, db_a] about the state (N-20 to N-24).
/// @param rates  compensated rates of the interval
[[nodiscard]] NavigationDynamics error_dynamics(const NavigationState& state,
                                                const InertialRates& rates) noexcept;

/// One discrete step: x(t+dt) = Phi x(t) + w, cov(w) = Qd. Phi = [kinematic_rows; 0 diag(bias_decay)].
struct NavigationTransition {
  NavigationDynamics kinematic_rows;             ///< I + F dt + F^2 dt^2/2, rows of dr, dv, phi (N-25)
  double gyro_bias_decay;                        ///< exp(-dt/T_g), exact
  double accel_bias_decay;                       ///< exp(-dt/T_a), exact
  NavigationErrorCovariance process_covariance;  ///< Qd (N-26), symmetric, positive semi-definite
};

/// @param state, rates  of the interval's middle or start; dt at most 0.1 s
[[nodiscard]] NavigationTransition transition(const NavigationState& state, const InertialRates& rates,
                                              const NavigationProcessNoise& noise, double dt_s) noexcept;

/// Adds an estimated error to the state.
void inject(NavigationState& state, const NavigationErrorVector& error) noexcept;

/// The error that inject() would have to add to `estimate` to reach `truth`. Exact inverse for small errors.
[[nodiscard]] NavigationErrorVector error_between(const NavigationState& truth,
                                                  const NavigationState& estimate) noexcept;

}  // namespace imuscope
