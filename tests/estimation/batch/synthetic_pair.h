#pragma once

/// Two IMUs on one body whose motion is known in closed form: rates, their derivative and forces. It is a sum of sines,
/// or turns by hand.
/// It shares no line with the estimate, and draws what the estimate has to find out.

#include <Eigen/Core>
#include <cstdint>

#include "estimation/batch/imu_record.h"

namespace synthetic {

struct PairOptions {
  double duration_s = 240.0;
  double reference_rate_hz = 100.0;
  double study_rate_hz = 100.0;
  Eigen::Matrix3d C_b_s = Eigen::Matrix3d::Identity();
  Eigen::Vector3d r_bs_b_m{0.35, -0.22, 0.12};
  double t_d_s = 0.0137;
  double clock_rate = 0.0;  ///< growth of t_d about the middle
  Eigen::Matrix3d gyro_matrix = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d accel_matrix = Eigen::Matrix3d::Identity();
  Eigen::Vector3d gyro_bias{0.004, -0.006, 0.002};
  Eigen::Vector3d accel_bias{0.05, -0.03, 0.08};
  double accel_delay_s = 0.0;
  Eigen::Matrix3d places_s_m = Eigen::Matrix3d::Zero();  ///< a row an accelerometer
  double reference_gyro_white = 1e-4;                    ///< rad/s/sqrt(Hz)
  double reference_accel_white = 1e-3;                   ///< m/s^2/sqrt(Hz)
  Eigen::Matrix3d reference_gyro_matrix = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d reference_accel_matrix = Eigen::Matrix3d::Identity();
  double reference_accel_delay_s = 0.0;  ///< of its accelerometers, behind its gyros
  double study_gyro_white = 2e-4;
  double study_accel_white = 2e-3;
  double motion = 1.0;             ///< factor of all rates and forces but gravity
  double road_rate = 0.0;          ///< an uneven road's part above 1 Hz, rad/s each of forty lines to 9 Hz
  double hop_rate = 0.0;           ///< the axles' hopping, rad/s each of sixty lines from 5 to 14 Hz
  bool turns = true;               ///< false: the body never turns
  bool laid_on_sides = false;      ///< instead of all this it is laid by hand on one side after the other
  double lost_share = 0.0;         ///< of the S-IMU's samples, singly
  double study_low_pass_hz = 0.0;  ///< a second-order Butterworth's corner, of all its axes; zero: none
  /// How far the S-IMU's mount turns under other forces than gravity's, in b, rad per m/s^2.
  Eigen::Matrix3d compliance_b = Eigen::Matrix3d::Zero();
};

struct Pair {
  imuscope::batch::ImuRecord reference;
  imuscope::batch::ImuRecord study;
};

/// By how much that low-pass is late for slow motion, s.
[[nodiscard]] double low_pass_delay_s(double corner_hz);

[[nodiscard]] Pair make_pair(const PairOptions& options, std::uint64_t seed);

}  // namespace synthetic
