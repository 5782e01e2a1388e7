#pragma once

/// What an IMU somewhere on the vehicle reads: the motion at its place and orientation, and its errors.
///
///   reading = quantise(clip((I + diag(scale) + misalignment) C_s_triad u + g_sensitivity f + bias + noise))
///
/// with u the true rate or force in the sensor's axes s, and f the force, as they were delay_s before and
/// through the sensor's low-pass where it has one. The force of axis i is that at the place of the
/// accelerometer i. By default samples are instantaneous, all accelerometers are at s's origin and nothing is
/// clipped or quantised.

#include <Eigen/Core>
#include <array>
#include <limits>
#include <optional>
#include <string_view>

#include "firmware_sim/imu/noise.h"
#include "firmware_sim/motion/motion.h"

namespace imusim {

/// Where the sensor sits.
struct Mounting {
  Eigen::Matrix3d C_b_s = Eigen::Matrix3d::Identity();  ///< rotates b to s
  Eigen::Vector3d r_bs_b_m = Eigen::Vector3d::Zero();   ///< from b's origin to s's origin
};

/// Errors of three axes of one kind, in rad/s (gyro) or m/s^2 (accelerometer).
struct TriadErrors {
  std::array<RegimeNoise, 3> noise;
  Eigen::Vector3d bias = Eigen::Vector3d::Zero();           ///< turn-on bias
  Eigen::Vector3d scale = Eigen::Vector3d::Zero();          ///< relative; 0.001 reads 0.1 % too much
  Eigen::Matrix3d misalignment = Eigen::Matrix3d::Zero();   ///< cross-coupling, rad; diagonal zero
  Eigen::Matrix3d g_sensitivity = Eigen::Matrix3d::Zero();  ///< gyro only: rad/s per m/s^2
  Eigen::Matrix3d C_s_triad = Eigen::Matrix3d::Identity();  ///< rotates s to the triad's own axes
  double delay_s = 0.0;                                     ///< a reading shows what was this long ago
  double quantisation = 0.0;                                ///< step; 0 for none
  double range = std::numeric_limits<double>::infinity();   ///< readings end at +-range
  /// Corner of the low-pass, a Butterworth of second order: it is later for fast motion than for slow.
  double low_pass_hz = std::numeric_limits<double>::infinity();
};

/// Matrix of a triad: what it makes of a constant rate or force in s.
Eigen::Matrix3d triad_matrix(const TriadErrors& errors);

/// The orthogonal frame that belongs to a triad, whose axes are the rows: x along its x axis, y in the plane
/// of its x and y axes. It is what an estimate of a crooked triad's mounting is an estimate of.
Eigen::Matrix3d triad_frame(const Eigen::Matrix3d& triad);

/// How far a triad's readings are behind a slow motion: its delay and that of its low-pass.
double slow_delay_s(const TriadErrors& errors);

/// Temperature of a sensor that warms up after it was switched on at the scenario's beginning.
struct Temperature {
  double begin_degC = 25.0;
  double end_degC = 25.0;
  double time_constant_s = 300.0;
  [[nodiscard]] double at(double t_s) const;
};

/// How the variance of the gyros' white noise follows what the sensor goes through: its logarithm changes by
/// so much a unit, from the value of the regime on.
struct NoiseDependence {
  double per_degC = 0.0;   ///< above the temperature at the beginning
  double per_radps = 0.0;  ///< of the magnitude of the angular rate
};

struct ImuErrors {
  TriadErrors gyro;
  TriadErrors accel;
  /// Column i: from s's origin to the accelerometer i, in s.
  Eigen::Matrix3d accel_places_s_m = Eigen::Matrix3d::Zero();
  /// What the sensor's mount adds to the vehicle's vibration, as a share of it; 0 where no engine runs.
  double own_vibration = 0.0;
  Temperature temperature;
  NoiseDependence gyro_white;
  RegimeSwitch regime_switch = RegimeSwitch::kContinuous;
};

/// One sample, in s.
struct ImuReading {
  Eigen::Vector3d omega_radps;
  Eigen::Vector3d f_mps2;
  /// Reading minus the true rate and force at the instant of the sample.
  Eigen::Vector3d gyro_error_radps;
  Eigen::Vector3d accel_error_mps2;
};

/// True rate and force at the sensor's place, in its axes.
struct IdealReading {
  Eigen::Vector3d omega_radps;
  Eigen::Vector3d f_mps2;
};
IdealReading ideal_reading(const MotionState& state, const Mounting& mounting);

/// What accelerometers at places of their own feel beyond one at s's origin, axis by axis.
/// @param places_s_m  column i: from s's origin to the accelerometer i, in s
Eigen::Vector3d size_effect(const MotionState& state, const Mounting& mounting,
                            const Eigen::Matrix3d& places_s_m);

class ImuModel {
 public:
  /// @param motion  must outlive the model
  /// @param name    of the device; with the seed it makes the noise reproducible
  ImuModel(const Motion& motion, const Mounting& mounting, const ImuErrors& errors, std::uint64_t seed,
           std::string_view name);

  /// The sample taken at t_s. Times must rise from call to call.
  ImuReading sample_at(double t_s);
  /// The same with the truth at t_s given, for callers that know it already. `seen` is what is left of it
  /// behind a low-pass, else the truth itself.
  ImuReading sample_of(const IdealReading& ideal, const IdealReading& seen, Regime regime, double t_s);

  [[nodiscard]] const Mounting& mounting() const { return mounting_; }
  [[nodiscard]] const ImuErrors& errors() const { return errors_; }

 private:
  using TriadNoise = std::array<NoiseSource, 3>;
  [[nodiscard]] IdealReading input_at(double t_s) const;
  IdealReading through_low_pass(const IdealReading& now, double t_s);

  const Motion* motion_;
  Mounting mounting_;
  ImuErrors errors_;
  TriadNoise gyro_noise_;
  TriadNoise accel_noise_;
  std::optional<Vibration> own_vibration_;  ///< in s
  bool disturbed_ = false;  ///< what the sensor feels is not the motion at its place and instant
  bool has_last_ = false;
  double last_t_s_ = 0.0;
  IdealReading last_input_{};
  IdealReading filtered_{};
  IdealReading filtered_slope_{};  ///< per second
};

}  // namespace imusim
