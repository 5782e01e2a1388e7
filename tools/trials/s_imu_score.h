#pragma once

/// How far estimates are off beside what was claimed for them, by kind of state, over many results.

#include <Eigen/Core>
#include <string>
#include <vector>

#include "estimation/calibration/estimator.h"

namespace s_imu_score {

/// Errors of one kind of state, and the sd published with each.
class StateScore {
 public:
  /// Nothing is counted where sd is 0: that state was not estimated.
  void add(double error, double sd);
  void add(const imuscope::Vector3& estimate, const imuscope::Vector3& sd, const Eigen::Vector3d& truth);
  void add(const StateScore& other);
  [[nodiscard]] int n() const { return n_; }
  [[nodiscard]] double rms() const;
  [[nodiscard]] double rms_sd() const;
  [[nodiscard]] double mean_z2() const;
  /// Share of the errors within 1.96 sd: 0.95 where the sd are right.
  [[nodiscard]] double coverage() const;

 private:
  int n_ = 0;
  int inside_ = 0;
  double error2_ = 0.0;
  double sd2_ = 0.0;
  double z2_ = 0.0;
};

/// What is true of one S-IMU, in the terms of SImuOutput.
struct SImuTruth {
  Eigen::Matrix3d C_b_s;
  Eigen::Vector3d r_bs_b_m;
  double t_d_s = 0.0;
  Eigen::Vector3d gyro_scale;
  Eigen::Vector3d accel_scale;
  Eigen::Matrix3d C_s_accel = Eigen::Matrix3d::Identity();  ///< rotates s to the accelerometer triad's axes
  double accel_t_d_s = 0.0;                                 ///< on top of t_d_s
};

/// (psi, r): true minus estimated.
Eigen::Matrix<double, 6, 1> mounting_error(const imuscope::SImuOutput& out, const SImuTruth& truth);
/// Its square in units of the published covariance: 6 in the mean where that is right.
double mounting_nees(const imuscope::SImuOutput& out, const SImuTruth& truth);

/// All kinds of one S-IMU.
class SImuScore {
 public:
  void add(const imuscope::SImuOutput& out, const SImuTruth& truth);
  void add(const SImuScore& other);
  [[nodiscard]] int n() const { return n_; }
  [[nodiscard]] double nees6() const { return nees6_ / n_; }
  /// One line per kind of state that was estimated: rms and sd (both over all axes), mean square in sd, and
  /// coverage.
  [[nodiscard]] std::string table() const;
  /// Whether NEES and the coverage of every kind are those of an honest estimator: 5.4 to 6.6, 93 to 97 %, within 3.3 of
  /// their own sd.
  [[nodiscard]] bool honest() const;

 private:
  struct Kind {
    const char* name;
    const char* unit;
    double per_si;
    StateScore score;
  };
  int n_ = 0;
  double nees6_ = 0.0;
  std::vector<Kind> kinds_ = all_kinds();
  static std::vector<Kind> all_kinds();
};

}  // namespace s_imu_score
