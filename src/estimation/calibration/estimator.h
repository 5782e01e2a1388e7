#pragma once

/// The estimator of imuscope: R-IMU/GNSS navigation with the calibration states of every S-IMU in one filter.
/// Live service, replay and study use this one class.
///
/// It is a pure function of the samples handed to it and of the cut times: no clock, no heap, lock, exception
/// or text after construction. Equations: EQUATIONS.md beside this file.

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "base/calibration_levels.h"
#include "base/time.h"
#include "estimation/calibration/estimator_config.h"
#include "estimation/calibration/events.h"
#include "sample/sample.h"
#include "sample/utc_scale.h"

namespace imuscope {

enum class NavigationStatus : std::uint8_t {
  kNotOffered,    ///< disabled, or no GNSS configured: the calibration runs without it
  kInitialising,  ///< waiting for R-IMU samples, attitude or a first position
  kAligning,      ///< levelled; heading still to be found
  kNavigating,
};

/// State at the newest R epoch. Everything but `status` is meaningful only while kNavigating.
struct NavigationOutput {
  NavigationStatus status = NavigationStatus::kInitialising;
  InitialisationMethod method = InitialisationMethod::kNone;
  HostTime time;  ///< of validity
  UtcTime utc;    ///< meaningful with has_utc
  bool has_utc = false;
  double latitude_rad = 0.0;
  double longitude_rad = 0.0;
  double height_m = 0.0;  ///< above the WGS-84 ellipsoid, of b's origin
  Vector3 v_n_mps{};
  Vector3 rpy_rad{};          ///< roll, pitch, heading of b relative to NED; heading in [0, 2 pi)
  Matrix3 C_b_n{};            ///< takes b to NED
  Vector3 gyro_bias_radps{};  ///< of the R-IMU, in b
  Vector3 accel_bias_mps2{};  ///< of the R-IMU, in b
  Vector3 sd_position_m{};    ///< north, east, down
  Vector3 sd_velocity_mps{};  ///< north, east, down
  Vector3 sd_rpy_rad{};
  Vector3 sd_gyro_bias_radps{};
  Vector3 sd_accel_bias_mps2{};
  Vector3 nis_position{};  ///< last GNSS position, per axis north, east, down
  Vector3 nis_velocity{};
  bool has_gnss = false;  ///< a solution went through an update since the navigation began
  HostTime gnss_time{};   ///< of validity of the newest such solution
  /// As found, from configured priors (estimation/navigation/antenna.h). Meaningful with has_gnss.
  Vector3 antenna_lever_arm_b_m{};
  Vector3 sd_antenna_lever_arm_m{};
  double receiver_latency_s = 0.0;  ///< beyond what UTC tags or pulses take out, where there are such
  double sd_receiver_latency_s = 0.0;
  bool gnss_contradicts = false;  ///< of the last minute, more than chance would refuse
};

/// What the wheels say and what has been learned of them. Nothing but `enabled` is meaningful without an
/// odometry device.
struct OdometryOutput {
  bool enabled = false;
  bool standing = false;  ///< the wheels have stood for a while
  bool resting = false;   ///< and rest is what the last update said
  bool lost = false;      ///< no speed for a while; the last one is not held
  bool has_speed = false;
  HostTime time;  ///< of validity of the newest speed
  double speed_mps = 0.0;
  double scale = 0.0;  ///< the wheels show (1 + scale) times the speed
  double sd_scale = 0.0;
  Vector3 mount_rad{};  ///< rotation vector that takes b to the vehicle's axes; no turn about x
  Vector3 sd_mount_rad{};
  Vector3 r_bv_b_m{};
  Vector3 sd_r_bv_b_m{};
  Vector3 nis{};  ///< mean over the last seconds: speed, sideways, upwards
};

/// Directions of the 6-dim (psi, r) space, for naming the weakest one.
enum class SImuDirection : std::uint8_t { kPsiX, kPsiY, kPsiZ, kRX, kRY, kRZ };

/// Counts since the start.
struct SImuCounters {
  std::uint64_t samples = 0;                  ///< received
  std::uint64_t used = 0;                     ///< went through a measurement update
  std::uint64_t late = 0;                     ///< reference did not come within late_after
  std::uint64_t no_reference = 0;             ///< inside a gap of the R-IMU, or before its start
  std::uint64_t waiting = 0;                  ///< now, for the reference
  std::uint64_t refused_full = 0;             ///< waiting queue was full
  std::uint64_t not_increasing = 0;           ///< time of validity at or before the previous sample's
  std::uint64_t not_finite = 0;               ///< NaN or infinity in the sample
  std::uint64_t coarse_attempts = 0;          ///< coarse alignments tried
  std::uint64_t resets = 0;                   ///< returns to kCoarse because the mounting changed
  std::array<std::uint64_t, 3> gated_gyro{};  ///< rejected by the gate, per axis
  std::array<std::uint64_t, 3> gated_accel{};
  std::array<std::uint64_t, 3> clipped_gyro{};  ///< left out because the axis was at the end of its range
  std::array<std::uint64_t, 3> clipped_accel{};
};

/// The estimate of one S-IMU at the newest processed S sample.
struct SImuOutput {
  CalibrationStatus status = CalibrationStatus::kWaiting;
  MountingGoal goal = kFinestGoal;  ///< what `kCalibrated` asks for
  Regime regime = Regime::kStatic;
  HostTime time;  ///< of validity of that sample
  /// To the gyro triad's frame: x along the x gyro, y in the plane of the x and y gyros.
  Matrix3 C_b_s{1, 0, 0, 0, 1, 0, 0, 0, 1};
  Matrix3 C_prior{1, 0, 0, 0, 1, 0, 0, 0, 1};  ///< configured, or the coarse alignment
  Vector3 psi_rad{};                           ///< -Log(C_prior^T C_b_s), in b
  Vector3 sd_psi_rad{};
  Vector3 r_bs_b_m{};
  Vector3 sd_r_bs_b_m{};
  double t_d_s = 0.0;
  double sd_t_d_s = 0.0;
  Vector3 gyro_bias_radps{};
  Vector3 sd_gyro_bias_radps{};
  Vector3 accel_bias_mps2{};
  Vector3 sd_accel_bias_mps2{};
  Vector3 gyro_scale{};
  Vector3 sd_gyro_scale{};
  Vector3 accel_scale{};
  Vector3 sd_accel_scale{};
  Vector3 accel_boresight_rad{};  ///< alpha of the accelerometer triad; sd 0: not estimated
  Vector3 sd_accel_boresight_rad{};
  double accel_t_d_s = 0.0;  ///< of the accelerometer triad, on top of t_d_s; sd 0: not estimated
  double sd_accel_t_d_s = 0.0;
  std::array<double, 36> covariance_psi_r{};  ///< row-major, rad and m
  Vector3 nis_gyro{};  ///< mean over the last seconds of innovation^2 / its predicted variance, per axis of s
  Vector3 nis_accel{};
  /// Unit vector in (psi, r), each scaled by its prior sd, in which least has been learned, the largest of
  /// its components, and sd left there relative to the prior (1 = nothing learned).
  std::array<double, 6> weakest_direction{};
  SImuDirection weakest_component = SImuDirection::kPsiX;
  double weakest_relative_sd = 1.0;
  /// Per component of (psi, r): sd below half of its prior or at its goal, and 20 s of motion fitted this
  /// mounting; none while samples or noise contradict the model. Otherwise: not observable yet.
  std::array<bool, 6> observable{};
  bool t_d_observable = false;
  bool contradicts = false;  ///< its samples do not fit the reference, whatever the mounting
  SImuCounters counters;
};

/// One S sample with the reference at its instant: the raw material of the error process.
struct SImuEpoch {
  std::size_t study = 0;
  HostTime time;       ///< of validity of the S sample
  double t_d_s = 0.0;  ///< reference below is taken at time + t_d_s
  UtcStamp utc;        ///< of the motion that the sample shows: at time + t_d_s
  ImuData sample;      ///< as received
  /// Reference compensated with the R biases named below, in b.
  Vector3 omega_ib_b_radps{};
  Vector3 omega_dot_ib_b_radps2{};
  Vector3 omega_ddot_ib_b_radps3{};
  Vector3 f_b_mps2{};
  Vector3 f_dot_b_mps3{};
  Vector3 reference_gyro_bias_radps{};
  Vector3 reference_accel_bias_mps2{};
  /// Estimate at this epoch, before its own update.
  Matrix3 C_b_s{};
  Vector3 r_bs_b_m{};
  Regime regime = Regime::kStatic;
  /// What the filter saw: sample minus prediction (biases and scales included), its variance by the model as
  /// it is (white + fast + H P H^T, nothing inflated), and the axes that were used. Zero unless
  /// `calibrating`.
  Vector3 innovation_gyro_radps{};
  Vector3 innovation_accel_mps2{};
  Vector3 variance_gyro{};
  Vector3 variance_accel{};
  std::array<bool, 3> used_gyro{};
  std::array<bool, 3> used_accel{};
  bool calibrating = false;  ///< filter is running: C_b_s and r_bs_b_m are estimates, not placeholders
};

/// Counts since the start that belong to no single S-IMU.
struct EstimatorCounters {
  std::uint64_t ticks = 0;
  std::uint64_t reference_samples = 0;
  std::uint64_t reference_gaps = 0;
  std::uint64_t reference_not_increasing = 0;
  std::uint64_t reference_not_finite = 0;
  std::uint64_t gnss_samples = 0;
  std::uint64_t gnss_used = 0;
  std::uint64_t gnss_rejected = 0;            ///< neither position nor velocity was used
  std::uint64_t gnss_positions_rejected = 0;  ///< the position was not used, whatever became of the velocity
  std::uint64_t gnss_too_old = 0;             ///< older than the ring of past states
  std::uint64_t gnss_not_finite = 0;
  std::uint64_t odometry_samples = 0;
  std::uint64_t odometry_speed_used = 0;
  std::uint64_t odometry_speed_rejected = 0;
  std::uint64_t odometry_slip_used = 0;  ///< non-holonomic updates
  std::uint64_t odometry_slip_rejected = 0;
  std::uint64_t zero_velocity_used = 0;
  std::uint64_t zero_velocity_rejected = 0;
  std::uint64_t odometry_too_old = 0;  ///< older than the ring of past states
  std::uint64_t odometry_not_finite = 0;
  std::uint64_t unknown_device = 0;
  std::uint64_t covariance_repairs = 0;
  std::uint64_t events_lost = 0;
  std::uint64_t epochs_lost = 0;  ///< more S samples became ready in one tick than epochs() can show
};

class HistorySink;

class Estimator {
 public:
  /// Checks the configuration by contract and allocates everything. `history`, where given, receives what the
  /// smoother needs (smoother.h) and must outlive the estimator.
  explicit Estimator(const EstimatorConfig& config, HistorySink* history = nullptr);
  ~Estimator();
  Estimator(const Estimator&) = delete;
  Estimator& operator=(const Estimator&) = delete;
  Estimator(Estimator&&) noexcept;
  Estimator& operator=(Estimator&&) noexcept;

  /// Takes one sample, in the order of arrival; R samples propagate the navigation at once.
  void add(const Sample& sample) noexcept;
  /// One tick: processes every S sample whose reference is complete, and gives up those that waited too long.
  /// Cuts do not decrease.
  void advance(HostTime cut) noexcept;

  /// What the PC's clock showed; its UTC counts until a device tells. Call before the first sample.
  void set_pc_clock(HostTime time, UtcTime utc) noexcept;

  /// Replaces the stochastic model of one S-IMU, at a tick boundary, no white noise below noise_floor_share
  /// of the configured. Where the bias process became larger, the bias variance grows by the difference (at
  /// most twofold); it is never reset and correlations stay. Precondition: every sd finite, every white sd
  /// positive.
  void set_noise(std::size_t study, const SImuNoise& noise) noexcept;

  [[nodiscard]] const NavigationOutput& navigation() const noexcept;
  [[nodiscard]] const OdometryOutput& odometry() const noexcept;
  /// UTC against the host's clock, as the devices tell it; what rates are integrated over.
  [[nodiscard]] const TimeScale& time_scale() const noexcept;
  [[nodiscard]] std::size_t study_count() const noexcept;
  [[nodiscard]] const SImuOutput& study(std::size_t index) const noexcept;
  /// S samples processed by the last advance(), per S-IMU in the order of time. Valid until the next
  /// advance().
  [[nodiscard]] std::span<const SImuEpoch> epochs() const noexcept;
  /// Since the advance() before the last.
  [[nodiscard]] std::span<const EstimatorEvent> events() const noexcept;
  [[nodiscard]] const EstimatorCounters& counters() const noexcept;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace imuscope
