#pragma once

/// Samples of a simulated vehicle with wheel sensors: R-IMU anywhere on it, GNSS that can be cut, wheels.
/// For the odometry's trial and its tests.

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "estimation/calibration/estimator.h"
#include "firmware_sim/imu/imu_model.h"
#include "firmware_sim/imu/wheel_speed.h"
#include "firmware_sim/motion/motion.h"

namespace imuscope::study {

enum class ReferenceClass : std::uint8_t {
  kNavigationGrade,  ///< Ixsea Airins
  kIndustrial,       ///< a good MEMS unit: 0.15 deg/sqrt(h), 10 deg/h, 1 mg
};

struct WheeledDriveOptions {
  double duration_s = 900.0;
  std::uint64_t seed = 1;  ///< of the sensors; the road is that of the scenario's own seed
  std::uint64_t road_seed = 1;
  ReferenceClass reference = ReferenceClass::kNavigationGrade;
  /// The R-IMU on the vehicle: from the middle of the rear axle, in the vehicle's axes, and its turn.
  Eigen::Vector3d r_vb_v_m{0.8, 0.3, -0.6};
  Eigen::Vector3d mount_rad{0.0, -0.014, 0.021};
  imusim::WheelErrors wheels;
};

class WheeledDrive {
 public:
  static constexpr DeviceIndex kReference = 0;
  static constexpr DeviceIndex kGnss = 1;
  static constexpr DeviceIndex kWheels = 2;
  static constexpr double kRate_hz = 100.0;
  static constexpr double kWheelRate_hz = 50.0;

  explicit WheeledDrive(const WheeledDriveOptions& options);

  /// The next 10 ms in order of arrival: one R sample, wheels fifty times a second, GNSS five times.
  /// The first sample is at host time 10 s.
  [[nodiscard]] std::vector<Sample> next();
  [[nodiscard]] bool done() const { return epoch_ >= epochs_; }
  /// Time of the samples that next() will return, since the start.
  [[nodiscard]] double time_s() const { return static_cast<double>(epoch_) / kRate_hz; }
  [[nodiscard]] const imusim::Motion& motion() const { return *motion_; }

  /// Of the R-IMU (b of the estimator).
  struct Truth {
    imusim::GeodeticPosition position;
    Eigen::Vector3d v_n_mps;
    Eigen::Matrix3d C_b_n;
  };
  [[nodiscard]] Truth truth_at(double t_s) const;
  /// From b's origin to the rear axle, in b.
  [[nodiscard]] Eigen::Vector3d r_bv_b_m() const;

  /// Knows the noise and where the antenna is; attitude at the start is given. Nothing is known of the wheels
  /// but that the axle is within 0.1 m of `axle_guess_b_m`.
  [[nodiscard]] EstimatorConfig config(const Eigen::Vector3d& axle_guess_b_m) const;

 private:
  WheeledDriveOptions options_;
  std::shared_ptr<const imusim::Motion> motion_;
  imusim::Mounting mounting_;
  std::uint64_t epoch_ = 0;
  std::uint64_t epochs_;
  imusim::Random random_;
  ReferenceConfig reference_config_;
  Eigen::Vector3d attitude_sd_rad_;
  Eigen::Vector3d attitude_error_rad_;
  std::unique_ptr<imusim::ImuModel> reference_;
  std::vector<imusim::WheelSpeed> wheels_;
};

/// Horizontal and vertical error of a navigation solution, m: truth minus estimate, north-east-down.
[[nodiscard]] Eigen::Vector3d position_error_n_m(const NavigationOutput& navigation,
                                                 const WheeledDrive::Truth& truth);

}  // namespace imuscope::study
