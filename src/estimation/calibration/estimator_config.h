#pragma once

/// What the estimator is told before it starts. All SI and radians; frames and symbols as in ARCHITECTURE.md.
/// A default is chosen so that three MTx-class S-IMUs beside a navigation-grade R-IMU work without tuning.

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "base/limits.h"
#include "base/units.h"
#include "estimation/calibration/covariance_loops.h"
#include "estimation/navigation/reference_grade.h"
#include "sample/regime.h"
#include "sample/sample.h"

namespace imuscope {

/// Row-major 3 x 3.
using Matrix3 = std::array<double, 9>;

/// What a body at rest feels, anywhere on Earth to 0.05 m/s^2.
inline constexpr double kNominalGravity_mps2 = 9.81;

/// Parts of the state of one S-IMU. Each can be left out; its quantity then stays at its prior value.
enum SImuBlock : std::uint32_t {
  kBoresightBlock = 1U << 0U,   ///< psi, rotation vector in b, C_b_s = C^_b_s Exp(-psi)
  kLeverArmBlock = 1U << 1U,    ///< r_bs_b
  kGyroBiasBlock = 1U << 2U,    ///< b_g, in s
  kAccelBiasBlock = 1U << 3U,   ///< b_a, in s
  kTimeOffsetBlock = 1U << 4U,  ///< t_d: the S sample at t shows the motion at t + t_d
  kGyroScaleBlock = 1U << 5U,   ///< s_g, in s
  kAccelScaleBlock = 1U << 6U,  ///< s_a, in s
  /// The accelerometer triad's own boresight alpha and time offset, on top of the gyro triad's psi and t_d,
  /// for sensors whose triads do not share their axes or their filters: C_accel = C_b_s A, A = A^
  /// Exp(-alpha).
  kAccelBoresightBlock = 1U << 7U,
  kAccelTimeOffsetBlock = 1U << 8U,
  kGyroAxesBlock = 1U << 9U,       ///< lean of the gyros' axes towards each other
  kAccelAxesBlock = 1U << 10U,     ///< likewise of the accelerometers'
  kAccelPlacesBlock = 1U << 11U,   ///< where the accelerometers are about their middle
  kGSensitivityBlock = 1U << 12U,  ///< rate that the gyros show per specific force
  /// Of the reference's accelerometers against its gyros, whose rates the forces of the lever arm are made of.
  kReferenceAccelTimeOffsetBlock = 1U << 13U,
};
/// What data sheets allow a sensor, and the reference's triads, to be beyond bias, scale and noise: 26 states.
inline constexpr std::uint32_t kSensorSImuBlocks = kAccelBoresightBlock | kAccelTimeOffsetBlock |
                                                   kGyroAxesBlock | kAccelAxesBlock | kAccelPlacesBlock |
                                                   kGSensitivityBlock | kReferenceAccelTimeOffsetBlock;
/// The 19 states of a sensor that is exactly rigid, orthogonal and of one delay.
inline constexpr std::uint32_t kFullSImuBlocks = 0x7FU;
/// All 45: the default.
inline constexpr std::uint32_t kCompleteSImuBlocks = kFullSImuBlocks | kSensorSImuBlocks;
/// The paper's own 6 states: boresight and lever arm.
inline constexpr std::uint32_t kPaperSImuBlocks = kBoresightBlock | kLeverArmBlock;
/// Biases alone, with everything else known: the second pass of a study, whose history is smoothed.
inline constexpr std::uint32_t kBiasSImuBlocks = kGyroBiasBlock | kAccelBiasBlock;

/// First-order Gauss-Markov process; an infinite time constant is a random constant.
struct GaussMarkovConfig {
  double sd = 0.0;  ///< stationary sd of the process, in the unit of the quantity
  double time_constant_s = std::numeric_limits<double>::infinity();
  friend bool operator==(const GaussMarkovConfig&, const GaussMarkovConfig&) = default;
};

/// The R-IMU's own errors, and how it is sampled.
struct ReferenceConfig {
  DeviceIndex device = 0;
  double rate_hz = 100.0;
  /// Taps of the differentiator that gives angular acceleration: 5, 7, 9 or 11 (all of polynomial order 4).
  /// 5 suits a fibre-optic reference (widest band), 7 to 11 a MEMS reference (least noise).
  int differentiator_points = 5;
  double gyro_white_radps_per_sqrt_hz = 0.0015 * kRadPerDeg / 60.0;  ///< angle random walk, rad/sqrt(s)
  double accel_white_mps2_per_sqrt_hz = 10.0 * kMps2PerMicroG;       ///< velocity random walk
  /// False: nobody said how good it is. S-IMUs are held against it as against industrial MEMS, until it rests and shows its
  /// noise (C-28).
  bool is_known = true;
  GaussMarkovConfig gyro_bias{0.005 * kRadPerDeg / kSecondsPerHour, 3600.0};
  GaussMarkovConfig accel_bias{5e-4, 3600.0};
  /// Its own scale and axes: no motion shows them, so that they stay in the sd of scales and of the S-IMU's
  /// accelerometer triad, where that is estimated, and in that of attitude, velocity and position (N-27, N-28).
  ReferenceGrade grade = kNavigationGrade;
};

/// N-28. What a start knows of the accelerometers' biases in b, m/s^2: turn-on, and what gravity shows of scale and axes.
[[nodiscard]] Vector3 start_accel_bias_sd_mps2(const ReferenceConfig& config) noexcept;

/// How far GNSS solutions are trusted, per solution kind (kSingle .. kFixed).
struct GnssConfig {
  bool enabled = false;
  DeviceIndex device = 0;
  Vector3 antenna_lever_arm_b_m{0.0, 0.0, 0.0};
  Vector3 antenna_lever_arm_sd_m{0.02, 0.02, 0.02};  ///< by tape, and an antenna's phase centre
  bool use_velocity = true;
  /// Of the stamps against validity, where no UTC tag brings a solution to the R-IMU's time.
  double latency_s = 0.0;
  /// Of the former. Receivers take some 20 to 200 ms to send their solution; how much, they do not say.
  double latency_sd_s = 0.1;
  /// Used where the receiver gives no sd: north, east, down; scaled up for a solution worse than kFixed.
  Vector3 default_sd_position_m{0.02, 0.02, 0.04};
  Vector3 default_sd_velocity_mps{0.05, 0.05, 0.05};
  /// Never believed to be better than this, whatever the receiver says.
  Vector3 floor_sd_position_m{0.01, 0.01, 0.02};
  Vector3 floor_sd_velocity_mps{0.02, 0.02, 0.02};
};

/// What the vehicle itself says of its motion: the speed that its wheels show, that it does not slip, and
/// that it stands. Six states: scale of the wheels, two angles between the vehicle and b, lever arm. Each
/// kind of update can be left out.
struct OdometryConfig {
  bool enabled = false;
  DeviceIndex device = 0;
  double rate_hz = 50.0;
  bool use_speed = true;          ///< forward speed of the wheels
  bool use_non_holonomic = true;  ///< neither sideways nor upwards
  bool use_zero_velocity = true;  ///< at standstill
  /// From b's origin to the point that does not slip sideways, to which the speed belongs: the middle of the
  /// axle that does not steer.
  Vector3 prior_r_bv_b_m{0.0, 0.0, 0.0};
  Vector3 prior_r_bv_b_sd_m{0.2, 0.2, 0.2};
  /// b against the vehicle's axes, about y and z of b.
  double prior_mount_sd_rad = 2.0 * kRadPerDeg;
  double prior_scale_sd = 0.03;
  /// Growth of the scale's sd: tyres warm up and wear. 0.05 % in an hour.
  double scale_walk_per_sqrt_s = 8e-6;
  /// What wheels and tyres do beyond the model; slow errors of about correlation_time_s, not white noise.
  double speed_sd_mps = 0.05;
  double sideways_sd_mps = 0.05;
  double upwards_sd_mps = 0.1;
  double correlation_time_s = 0.5;
  /// Slip angle of the axle in a turn per lateral acceleration (cornering compliance), rad per m/s^2; the
  /// sideways speed that it allows adds to sideways_sd_mps.
  double slip_rad_per_mps2 = 0.003;
  double zero_velocity_sd_mps = 0.01;
  /// Below this, wheel sensors may show zero while the vehicle moves: such a speed is not used as one.
  double dead_band_mps = 0.6;
};

/// Start of the navigation. What is absent is found from the R-IMU's own attitude, from rest, or in motion.
struct NavigationConfig {
  bool enabled = true;  ///< false: calibration alone, also where there is GNSS
  /// Roll, pitch, heading of b, with sd; the vehicle then stands until the first GNSS position.
  std::optional<Vector3> initial_rpy_rad;
  Vector3 initial_rpy_sd_rad{0.01 * kRadPerDeg, 0.01 * kRadPerDeg, 0.03 * kRadPerDeg};
};

/// Noise of one S-IMU sensor triad in one regime, per axis of s, at the sensor's own rate.
struct TriadNoise {
  Vector3 white_sd{0.0, 0.0, 0.0};  ///< per sample
  /// Fast Gauss-Markov process (time constant of a second or less); it inflates the filter's R to its
  /// low-frequency equivalent and enters the NIS as it is.
  Vector3 fast_sd{0.0, 0.0, 0.0};
  Vector3 fast_time_constant_s{0.0, 0.0, 0.0};  ///< 0: none
  friend bool operator==(const TriadNoise&, const TriadNoise&) = default;
};

/// The stochastic model of one S-IMU. This is what a fitted noise model replaces (Estimator::set_noise).
struct SImuNoise {
  std::array<TriadNoise, kRegimeCount> gyro;   ///< rad/s
  std::array<TriadNoise, kRegimeCount> accel;  ///< m/s^2
  /// Slow part of the bias: Gauss-Markov, per axis.
  std::array<GaussMarkovConfig, 3> gyro_bias;
  std::array<GaussMarkovConfig, 3> accel_bias;
  friend bool operator==(const SImuNoise&, const SImuNoise&) = default;
};

/// MTx class: the dynamic and static gyro models of the paper's Table II, accelerometer of its data sheet's
/// class.
SImuNoise mtx_class_noise();

/// One S-IMU: priors, noise and which states it has.
struct SImuConfig {
  DeviceIndex device = 0;
  double rate_hz = 100.0;
  std::uint32_t blocks = kFullSImuBlocks;
  SImuNoise noise = mtx_class_noise();
  /// A model that is handed in later is not believed where its white noise lies below this share of what is
  /// configured: the filter's own residuals must not talk it into over-confidence.
  double noise_floor_share = 0.5;
  /// Samples from one measurement update to the next, 1 to 50; an update takes a weighted mean over twice as
  /// many. 0: chosen from the reference's noise and the motion (C-15). No sample is left out.
  int average_samples = 0;

  /// Mounting. Absent: found by the coarse alignment, to any rotation.
  std::optional<Matrix3> prior_C_b_s;
  Vector3 prior_boresight_sd_rad{2.0 * kRadPerDeg, 2.0 * kRadPerDeg, 2.0 * kRadPerDeg};
  /// Growth of the boresight's variance per second (mount creep), rad/sqrt(s). 0: rigid.
  double boresight_creep_rad_per_sqrt_s = 0.0;

  Vector3 prior_r_bs_b_m{0.0, 0.0, 0.0};
  Vector3 prior_r_bs_b_sd_m{0.5, 0.5, 0.5};

  /// Time offset. Absent: found by the coarse alignment within +-coarse_search_s.
  std::optional<double> prior_t_d_s;
  double prior_t_d_sd_s = 0.01;
  double coarse_search_s = 2.0;

  /// Accelerometer triad against gyro triad, where these blocks are switched on; both start at zero. A data
  /// sheet's alignment error is of the order of 0.1 deg.
  Vector3 prior_accel_boresight_sd_rad{0.1 * kRadPerDeg, 0.1 * kRadPerDeg, 0.1 * kRadPerDeg};
  double prior_accel_t_d_sd_s = 2e-3;
  double prior_reference_accel_t_d_sd_s = 1e-3;

  /// What data sheets of industrial MEMS allow (MTx: alignment 0.1 deg, 0.05 deg/s per g); all start at zero.
  double prior_axes_sd_rad = 0.05 * kRadPerDeg;  ///< each of a pair leans by half of their departure
  double prior_place_sd_m = 0.02;
  double prior_g_sensitivity_sd = 0.05 * kRadPerDeg / kMps2PerG;  ///< rad/s per m/s^2

  Vector3 prior_gyro_bias_radps{0.0, 0.0, 0.0};
  Vector3 turn_on_gyro_sd_radps{0.3 * kRadPerDeg, 0.3 * kRadPerDeg, 0.3 * kRadPerDeg};
  Vector3 prior_accel_bias_mps2{0.0, 0.0, 0.0};
  Vector3 turn_on_accel_sd_mps2{0.05, 0.05, 0.05};
  Vector3 prior_gyro_scale{0.0, 0.0, 0.0};
  Vector3 prior_gyro_scale_sd{0.003, 0.003, 0.003};
  Vector3 prior_accel_scale{0.0, 0.0, 0.0};
  Vector3 prior_accel_scale_sd{0.003, 0.003, 0.003};
};

struct EstimatorConfig {
  ReferenceConfig reference;
  GnssConfig gnss;
  OdometryConfig odometry;
  NavigationConfig navigation;
  std::vector<SImuConfig> studies;  ///< at most kMaxSImus; outputs are in this order

  /// Probability with which a good measurement of one axis passes the gate.
  double gate_probability = 0.99999;
  /// E-2. An S sample waits this long (on the arrival time scale) for its reference, then counts as late.
  Duration late_after = from_seconds(kReferenceWait_s);
  /// Instructions that the covariance is worked out with. Absent: the widest that the processor has.
  std::optional<InstructionSet> instruction_set;
};

}  // namespace imuscope
