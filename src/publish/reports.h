#pragma once

/// What the service has to say, as plain values in SI and radians. The publisher turns them into LCM
/// messages, which speak degrees, milliseconds and microseconds. Unknown numbers are NaN.
///
/// NavigationReport and ErrorReport are trivially copyable: they cross the ring from the estimator to the
/// publisher. The others are made in the soft world.

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "base/time.h"
#include "sample/regime.h"
#include "sample/sample.h"

namespace imuscope {

inline constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

/// Navigation solution of frame b's origin at one epoch.
struct NavigationReport {
  UtcTime utc;          ///< time of validity
  double time_s;        ///< time of validity, seconds since the run's first R-IMU epoch
  double latitude_rad;  ///< WGS-84 geodetic
  double longitude_rad;
  double height_m;          ///< above the ellipsoid
  Vector3 v_n_mps;          ///< relative to the Earth, north-east-down
  Vector3 rpy_rad;          ///< roll, pitch, heading of b relative to north-east-down
  Vector3 sd_position_m;    ///< north, east, down
  Vector3 sd_velocity_mps;  ///< north, east, down
  Vector3 sd_rpy_rad;
};
static_assert(std::is_trivially_copyable_v<NavigationReport>);

/// What the wheels show and what has been learned of them; fields as odometry_t.
struct OdometryReport {
  UtcTime utc;    ///< time of validity of the speed
  double time_s;  ///< time of validity, seconds since the run's first R-IMU epoch
  double speed_mps;
  bool standing;
  bool zero_velocity;
  bool lost;
  double scale;
  double sd_scale;
  Vector3 mount_rad;  ///< rotation vector that takes b to the vehicle's axes
  Vector3 sd_mount_rad;
  Vector3 r_bv_b_m;  ///< to the middle of the axle
  Vector3 sd_r_bv_b_m;
  Vector3 nis;  ///< speed, sideways, upwards
  std::uint64_t speed_used;
  std::uint64_t speed_rejected;
  std::uint64_t non_holonomic_used;
  std::uint64_t non_holonomic_rejected;
  std::uint64_t zero_velocity_used;
  std::uint64_t zero_velocity_rejected;
};
static_assert(std::is_trivially_copyable_v<OdometryReport>);

/// The states of one S-IMU; used once for values and once for standard deviations.
struct CalibrationStates {
  Vector3 psi_b_rad;          ///< boresight, rotation vector -Log(C_prior^T C_b_s), resolved in b
  Vector3 r_bs_b_m;           ///< lever arm from b to s, resolved in b
  double t_d_s;               ///< added to the S time
  Vector3 gyro_bias_s_radps;  ///< resolved in s
  Vector3 accel_bias_s_mps2;
  Vector3 gyro_scale;  ///< error, dimensionless, along s
  Vector3 accel_scale;
};

/// Calibration of one S-IMU at one epoch.
struct CalibrationReport {
  UtcTime utc;    ///< time of validity
  double time_s;  ///< time of validity, seconds since the run's first R-IMU epoch
  DeviceIndex device;
  std::array<double, 4> q_b_s;  ///< C_b_s as a Hamilton quaternion w, x, y, z
  CalibrationStates value;
  CalibrationStates sd;
  /// psi_x, psi_y, psi_z, r_x, r_y, r_z, t_d: the motion has shown it. Where not, no value is published.
  std::array<bool, 7> observable{};
  double goal_sd_psi_rad = kUnknown;
  double goal_sd_r_m = kUnknown;
  double goal_sd_t_d_s = kUnknown;
  std::string weakest_direction;  ///< in words
  double weakest_relative_sd = kUnknown;
  std::string advice;  ///< the manoeuvre that would help most
};

/// One row of the error process of one S-IMU, resolved in s.
struct ErrorReport {
  UtcTime utc;    ///< time of validity of the S sample
  double time_s;  ///< time of validity, seconds since the run's first R-IMU epoch
  DeviceIndex device;
  Regime regime;
  std::int64_t counter;  ///< the S-IMU's own, unwrapped
  Vector3 gyro_radps;
  Vector3 accel_mps2;
};
static_assert(std::is_trivially_copyable_v<ErrorReport>);

/// Wavelet variance of one axis in one regime.
struct AxisWaveletVariance {
  /// One level j of the wavelet variance; it looks at means over 2^(j-1) samples.
  struct Level {
    int level;      ///< 1, 2, ...
    double tau_s;   ///< 2^level / rate
    double value;   ///< unit squared
    double ci_low;  ///< 95 % interval
    double ci_high;
    std::int64_t n_coefficients;
  };
  std::string axis;  ///< gyro_x .. accel_z
  std::string regime;
  std::string unit;    ///< of the axis
  std::int64_t n = 0;  ///< samples
  double rate_hz = 0.0;
  std::vector<Level> levels;
};

/// Wavelet variances of one S-IMU at a refit.
struct WaveletVarianceReport {
  UtcTime utc;  ///< of the last sample used
  double time_s = 0.0;
  std::string name;
  std::vector<AxisWaveletVariance> axes;
};

/// Stochastic model of one axis in one regime; fields as `imuscope fit --json`.
struct AxisNoiseModel {
  /// One parameter, in the terms of noise::ParameterEstimate; sd and interval are NaN where it is not
  /// identifiable.
  struct Parameter {
    std::string process;
    std::string name;
    std::string unit;
    double value = kUnknown;
    double sd = kUnknown;
    double ci_low = kUnknown;
    double ci_high = kUnknown;
  };
  /// The model's curve at one level of the wavelet variance.
  struct Fitted {
    double tau_s;
    double value;  ///< wavelet variance implied by the model, unit squared
  };
  std::string axis;
  std::string regime;
  std::string unit;
  std::int64_t n = 0;
  double rate_hz = 0.0;
  std::string model;
  std::string weights;
  std::vector<Parameter> parameters;
  std::vector<Fitted> fitted;
  double objective = kUnknown;
  double j_statistic = kUnknown;
  double j_dof = kUnknown;
  double j_p_value = kUnknown;
  double criterion = kUnknown;
  /// Distance of the samples since the last refit from the model before them; unknown at the first.
  double change_statistic = kUnknown;
  double change_dof = kUnknown;
  double change_p_value = kUnknown;
  bool changed = false;
  bool identifiable = false;
  std::vector<std::string> warnings;
};

/// Noise models of one S-IMU at a refit.
struct NoiseModelReport {
  UtcTime utc;  ///< of the last sample used
  double time_s = 0.0;
  std::string name;
  std::vector<AxisNoiseModel> models;
};

/// Motion of one axis of a S-IMU and how its error follows it; fields as axis_dynamics_t.
struct AxisMotion {
  std::string axis;
  std::string unit;
  double mean = kUnknown;
  double rms = kUnknown;
  double largest = kUnknown;
  double slope = kUnknown;
  double slope_sd = kUnknown;
  double correlation = kUnknown;
  double r2 = kUnknown;
  double f = kUnknown;
  double p_value = kUnknown;
};

/// One covariate of the regression; fields as covariate_motion_t.
struct CovariateMotion {
  std::string name;
  std::string unit;
  double mean = kUnknown;
  double rms = kUnknown;
  double largest = kUnknown;
};

/// Motion of one S-IMU at a refit.
struct DynamicsReport {
  UtcTime utc;  ///< of the last sample used
  double time_s = 0.0;
  std::string name;
  std::int64_t n_static = 0;
  std::int64_t n_dynamic = 0;
  std::vector<AxisMotion> axes;
  std::vector<CovariateMotion> covariates{};
};

/// What the bridge to the widespread pose_t and ins_t shows, in their frames: body forward-left-up, local
/// east-north-up from the first solution on.
struct BridgeReport {
  UtcTime utc;  ///< time of validity
  Vector3 position_l_m{};
  Vector3 velocity_b_mps{};
  std::array<double, 4> q_b_l{1.0, 0.0, 0.0, 0.0};  ///< rotates body to local; w, x, y, z
  Vector3 rate_lb_b_radps{};                        ///< of the body relative to the local frame
  Vector3 acceleration_b_mps2{};                    ///< gravity removed
  std::int64_t counter = 0;                         ///< of the R-IMU
  Vector3 measured_omega_b_radps{};
  Vector3 measured_f_b_mps2{};
};

/// What a person marked.
struct PersonEvent {
  UtcTime utc;
  std::string source;
  std::string text;
};

/// Health of the service. Counts are since the start of the run.
struct StatusReport {
  /// One device of the configuration and its line; `problem` is empty while all is well, and names the remedy
  /// else.
  struct Device {
    std::string name;
    std::string role;
    std::string protocol;
    std::string state;
    std::string problem;
    double rate_hz = 0.0;  ///< samples per second over the last status interval
    std::uint64_t bytes = 0;
    std::uint64_t bytes_skipped = 0;
    std::uint64_t frames = 0;
    std::uint64_t frames_dropped = 0;  ///< lost by this PC before they could be read
    std::uint64_t bad_checksums = 0;
    std::uint64_t samples = 0;
    std::uint64_t samples_lost = 0;
    std::uint64_t samples_late = 0;
    std::uint64_t samples_refused = 0;
    std::uint64_t clock_resets = 0;
    double latency_s = kUnknown;
    double clock_drift_ppm = kUnknown;
    double clock_sd_s = kUnknown;  ///< scatter about the line that maps its clock to the host's
  };
  /// How far one S-IMU's calibration has come.
  struct Study {
    std::string name;
    std::string state;
    std::string regime;
    double sd_psi_rad = kUnknown;  ///< largest of the three axes, like the next
    double goal_psi_rad = kUnknown;
    double sd_r_m = kUnknown;
    double goal_r_m = kUnknown;
    double sd_t_d_s = kUnknown;
    double goal_t_d_s = kUnknown;
    std::string weakest;
    double weakest_relative = kUnknown;
    std::string manoeuvre;
    std::uint64_t samples = 0;
    std::uint64_t used = 0;
    std::uint64_t late = 0;
    std::uint64_t gated = 0;
  };
  /// How late, in the terms of LatenessHistogram: median, 99 %, 99.9 % and the worst since the start.
  struct Quantiles {
    double p50_s = kUnknown;
    double p99_s = kUnknown;
    double p999_s = kUnknown;
    double max_s = kUnknown;
  };
  /// One thread of the process; `ticks` and what follows it are known of the periodic ones only: I/O,
  /// estimator, publisher.
  struct Thread {
    std::string name;
    std::string scheduling;       ///< what was granted: "fifo 80", "normal", "idle"
    double cpu_share = kUnknown;  ///< of one core, over the last status interval
    std::uint64_t ticks = 0;
    std::uint64_t overruns = 0;
    std::uint64_t skipped = 0;
    Quantiles lateness;                           ///< unknown for a thread without deadlines
    Quantiles done;                               ///< from the deadline until the work was handed on
    std::vector<std::uint64_t> lateness_octaves;  ///< see LatenessHistogram::octaves()
  };
  /// One queue between threads, counted in its elements: what waits now, at most so far, and what found it
  /// full.
  struct Ring {
    std::string name;
    std::uint64_t capacity = 0;
    std::uint64_t level = 0;
    std::uint64_t high_water = 0;
    std::uint64_t refused = 0;
  };
  UtcTime utc;  ///< of this report
  std::string run;
  std::string version;
  std::string build;  ///< compiler
  std::string configuration_hash;
  std::string state;   ///< starting, aligning, running, degraded, failed
  std::string reason;  ///< why it is in that state
  double uptime_s = 0.0;
  std::int64_t tick = 0;
  std::uint64_t refits = 0;
  double refit_duration_s = kUnknown;
  std::optional<UtcTime> refit_utc;  ///< when the last one was finished
  std::uint64_t resident_memory_bytes = 0;
  std::string capture_path;
  std::uint64_t capture_bytes = 0;
  std::uint64_t capture_lost = 0;
  std::string last_event;  ///< what a person marked
  std::vector<Device> devices;
  std::vector<Study> studies;
  std::vector<Thread> threads;
  std::vector<Ring> rings;
  std::vector<std::string> problems;  ///< each with its remedy
};

}  // namespace imuscope
