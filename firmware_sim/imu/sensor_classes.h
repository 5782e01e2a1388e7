#pragma once

/// The two kinds of IMU that are simulated, as numbers: a MEMS sensor of the XSens MTx class and a
/// fibre-optic one of the Ixsea Airins class.

#include <array>

#include "firmware_sim/imu/imu_model.h"
#include "firmware_sim/random/random.h"

namespace imusim {

/// Which parameters of the MTx's gyro noise are in force.
enum class GyroNoiseChoice {
  kByRegime,    ///< static at rest, dynamic in motion
  kAllStatic,   ///< static throughout
  kAllDynamic,  ///< dynamic throughout
};

/// Gyro noise of the MTx in (rad/s)^2: white and two Gauss-Markov processes, the static and the dynamic model
/// of the paper's Table II.
RegimeNoise mtx_gyro_noise(GyroNoiseChoice choice);

/// Accelerometer noise of the MTx: white and one Gauss-Markov process of 0.02 m/s^2 and 645 s. An assumption,
/// as the paper has no accelerometer model.
RegimeNoise mtx_accel_noise(double white_sd_mps2);

/// How an MTx is drawn: standard deviations of what differs from unit to unit and from start to start.
struct MtxClass {
  GyroNoiseChoice gyro_noise = GyroNoiseChoice::kByRegime;
  RegimeSwitch regime_switch = RegimeSwitch::kContinuous;
  double accel_white_sd_mps2 = 0.03;  ///< 0.15 is the study's vibration scenario
  double gyro_bias_sd_radps = 0.3 * 3.14159265358979323846 / 180.0;
  double accel_bias_sd_mps2 = 0.05;
  double gyro_scale_sd = 0.003;
  double accel_scale_sd = 0.003;
};
ImuErrors draw_mtx(const MtxClass& mtx, Random& random);

/// A reference, by default of class 1: white noise densities and constant biases.
struct ReferenceClass {
  double gyro_white_radps_per_sqrt_hz = 0.0015 / 60.0 * 3.14159265358979323846 / 180.0;
  double accel_white_mps2_per_sqrt_hz = 10e-6 * 9.80665;
  double gyro_bias_sd_radps = 0.005 / 3600.0 * 3.14159265358979323846 / 180.0;
  double accel_bias_sd_mps2 = 5e-4;
};
/// What a reference may be: navigation-grade fibre-optic (0.0015 deg/sqrt(h)), fibre-optic AHRS (0.03),
/// tactical MEMS (0.125), industrial MEMS (0.3), and an MTx's own class (4.8). Accelerometers alike.
inline constexpr int kReferenceClasses = 5;
/// @param number  1 to kReferenceClasses, by falling quality
ReferenceClass reference_class(int number);
ImuErrors draw_reference(const ReferenceClass& airins, double rate_hz, Random& random);

}  // namespace imusim
