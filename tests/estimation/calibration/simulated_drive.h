#pragma once

/// Samples of a simulated drive for the estimator's tests: a fibre-optic R-IMU, S-IMUs of MTx class, GNSS.

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "estimation/calibration/estimator.h"
#include "firmware_sim/imu/imu_model.h"
#include "firmware_sim/motion/motion.h"

namespace imuscope::test {

struct SimulatedStudy {
  Eigen::Matrix3d C_b_s = Eigen::Matrix3d::Identity();
  Eigen::Vector3d r_bs_b_m = Eigen::Vector3d(0.35, -0.22, 0.12);
  double t_d_s = 0.004;  ///< the sample stamped t shows the motion at t + t_d
  /// Of the accelerometer triad on top: C_accel = C_b_s Exp(-alpha), and its time offset.
  Eigen::Vector3d alpha_rad = Eigen::Vector3d::Zero();
  double accel_t_d_s = 0.0;
};

class SimulatedDrive {
 public:
  static constexpr DeviceIndex kReference = 0;
  static constexpr DeviceIndex kFirstStudy = 1;
  static constexpr DeviceIndex kGnss = 9;
  static constexpr double kRate_hz = 100.0;

  SimulatedDrive(double duration_s, std::vector<SimulatedStudy> studies, std::uint64_t seed = 1,
                 imusim::ScenarioKind kind = imusim::ScenarioKind::kDrive);

  /// The next 10 ms, in order of arrival: one R sample, one of every S-IMU, GNSS five times a second. The
  /// first sample is at host time 10 s.
  std::vector<Sample> next();
  [[nodiscard]] bool done() const { return epoch_ >= epochs_; }
  /// Time of the samples that next() will return, since the start.
  [[nodiscard]] double time_s() const { return static_cast<double>(epoch_) / kRate_hz; }

  [[nodiscard]] const imusim::Motion& motion() const { return motion_; }
  /// Configuration that knows the noise but nothing of mounting and time offset; attitude at the start is
  /// given.
  [[nodiscard]] EstimatorConfig config() const;
  /// Turns an S-IMU on its mount.
  void remount(std::size_t study, const Eigen::Matrix3d& C_b_s);

 private:
  imusim::Motion motion_;
  std::uint64_t seed_;
  std::uint64_t epoch_ = 0;
  std::uint64_t epochs_;
  std::vector<SimulatedStudy> truth_;
  imusim::Random random_;
  std::unique_ptr<imusim::ImuModel> reference_;
  std::vector<imusim::ImuErrors> errors_;
  std::vector<imusim::ImuModel> studies_;
  std::vector<imusim::ImuModel> accels_;  ///< the accelerometer triads, where their time is their own
};

/// Error of the estimated mounting: psi with C_true = C_estimated Exp(-psi).
Eigen::Vector3d mounting_error_rad(const SImuOutput& out, const Eigen::Matrix3d& C_b_s_true);
/// Largest error of boresight and lever arm, in their sd.
double worst_in_sd(const SImuOutput& out, const SimulatedStudy& truth);
double horizontal_error_m(const NavigationOutput& out, const imusim::MotionState& truth);

/// Feeds `drive` to `estimator` until its end or until `until_s`, ticking after every 10 ms.
void run(SimulatedDrive& drive, Estimator& estimator, double until_s = 1e9);

}  // namespace imuscope::test
