#pragma once

/// An INS/GNSS filter whose only IMU is one S-IMU, with every process of its noise model as a state: 9 of
/// navigation (of frame s), then per axis a constant bias (or random walk) and its slow Gauss-Markov
/// processes. Copying it is what an outage starts from. EQUATIONS.md V-1 to V-4.
///
/// NavigationState's b is frame s here: the filter knows no other IMU. Thread: one. Allocates: never after
/// construction, save copies.

#include <Eigen/Core>
#include <array>
#include <vector>

#include "estimation/navigation/error_model.h"
#include "estimation/navigation/gnss_gate.h"
#include "estimation/navigation/gnss_measurement.h"
#include "estimation/navigation/navigation_state.h"
#include "study/evaluation/coasting_model.h"

namespace imuscope {

using KinematicVector = Eigen::Matrix<double, kNavigationKinematicSize, 1>;
using KinematicCovariance = Eigen::Matrix<double, kNavigationKinematicSize, kNavigationKinematicSize>;

class CoastingFilter {
 public:
  /// @param start  position, velocity, attitude of s; its biases are taken as the bias states' first value
  /// @param sd     of position (NED, m), velocity (m/s), attitude (phi, rad)
  CoastingFilter(const CoastingModel& model, const NavigationState& start, const KinematicVector& sd);

  /// Carries state and covariance over one interval, at most kStepMax_s long.
  /// @param begin, end     measured at its ends, in s axes
  /// @param white_density  in force, per axis
  void propagate(const InertialRates& begin, const InertialRates& end, double dt_s,
                 const std::array<double, kImuAxes>& white_density);
  static constexpr double kStepMax_s = 0.1;

  /// GNSS position of the antenna, r_sa_s from s's origin. False where the gate refused it.
  bool update_position(HostTime time, const GeodeticPosition& antenna, const Eigen::Vector3d& sd_m,
                       const Eigen::Vector3d& r_sa_s_m);
  /// GNSS velocity of the antenna; `measured` at its time.
  bool update_velocity(HostTime time, const Eigen::Vector3d& v_n_mps, const Eigen::Vector3d& sd_mps,
                       const InertialRates& measured, const Eigen::Vector3d& r_sa_s_m);

  /// With the sum of each axis's bias states as its biases.
  [[nodiscard]] const NavigationState& state() const noexcept { return state_; }
  /// Of position, velocity and attitude; with what a tilt does to the vertical in second order, which grows
  /// where nothing is measured (V-7).
  [[nodiscard]] KinematicCovariance covariance();

 private:
  struct Bias {
    std::size_t axis;
    double rate_per_s;  ///< 0: constant, or random walk
    double variance;    ///< stationary, where there is a rate
    double walk_density;
    double value;
  };
  using StateMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic>;

  void settle();
  void add_second_order(double specific_force_mps2, double dt_s);
  void sum_biases();
  bool update(GnssGate& gate, HostTime time, const GnssInnovation& measured, const Eigen::Vector3d& sd);

  NavigationState state_;
  std::vector<Bias> biases_;
  StateMatrix P_;
  GnssGate position_gate_;
  GnssGate velocity_gate_;
  /// Rms since the last fix of what the squares of the tilt add to the way down.
  double second_order_v_mps_ = 0.0;
  double second_order_r_m_ = 0.0;

  /// What has been carried by the state but not yet by the covariance.
  struct Pending {
    NavigationState begin;
    Eigen::Vector3d omega_sum = Eigen::Vector3d::Zero();  ///< integral of the compensated rate
    Eigen::Vector3d f_sum = Eigen::Vector3d::Zero();
    std::array<double, kImuAxes> density_sum{};
    double dt_s = 0.0;
  } pending_;
};

}  // namespace imuscope
