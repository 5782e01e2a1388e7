#pragma once

/// Finds the first navigation state, so that the filter can start. Three ways, in this order of preference:
///
/// 1. the R-IMU's own attitude solution, once it says that its heading is valid;
/// 2. at rest: level from the mean specific force, heading from the Earth's rate (gyrocompass) where the
///    gyro's bias and noise leave a heading better than the limit;
/// 3. in motion, for a MEMS reference: level at rest, carry the attitude on with the gyros from an arbitrary
///    heading, and find that heading by least squares between the accelerations that the IMU felt and those
///    that GNSS positions show, over windows of several seconds. Needs no assumption on how the IMU is turned
///    about the vertical and no GNSS velocity. EQUATIONS.md N-40 to N-46, N-48.
///
/// All need a GNSS position. Core: fixed memory (about 40 kB), no allocation, noexcept. Thread: owner only.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>

#include "base/time.h"
#include "base/units.h"
#include "estimation/navigation/error_model.h"
#include "estimation/navigation/so3.h"

namespace imuscope {

enum class AlignmentMethod : std::uint8_t { kReferenceAttitude, kGyrocompass, kInMotion };

enum class AlignmentStage : std::uint8_t {
  kWaitingForRest,      ///< no rest seen yet, so no level
  kWaitingForHeading,   ///< level; heading comes with the gyrocompass's averaging or with motion
  kWaitingForPosition,  ///< attitude is known, GNSS position is not
  kDone,
};

/// Attitude with its sd: rotation vector about north, east, down (phi).
struct InitialAttitude {
  Eigen::Matrix3d C_b_n = Eigen::Matrix3d::Identity();
  Eigen::Vector3d sd_n_rad = Eigen::Vector3d::Zero();
};

/// Level attitude of an IMU at rest (N-40). Heading is set to the given one; its sd to pi.
/// @param mean_f_b_mps2   mean specific force at rest
/// @param sd_f_mps2       of that mean, bias included
[[nodiscard]] InitialAttitude level_from_rest(const Eigen::Vector3d& mean_f_b_mps2, double sd_f_mps2,
                                              double heading_rad) noexcept;

/// Level attitude and heading from the Earth's rate (N-41).
/// @param sd_omega_radps  of the mean rate, bias included
[[nodiscard]] InitialAttitude gyrocompass(const Eigen::Vector3d& mean_omega_ib_b_radps,
                                          const Eigen::Vector3d& mean_f_b_mps2, double sd_omega_radps,
                                          double sd_f_mps2, double latitude_rad) noexcept;

/// What the R-IMU showed at rest, for the filter to take as a measurement of tilt, heading and biases at
/// once.
struct AlignmentRest {
  InertialRates mean;                                   ///< as measured
  double length_s = 0.0;                                ///< 0: there was none
  double age_s = 0.0;                                   ///< since its end
  Eigen::Matrix3d C_b_n = Eigen::Matrix3d::Identity();  ///< then
  double sway_radps = 0.0;  ///< sd of what a parked vehicle's swaying leaves of rate
};

/// Where the filter starts.
struct InitialNavigation {
  NavigationState state;
  HostTime time{};  ///< of the newest IMU sample handed in
  NavigationErrorVector sd =
      NavigationErrorVector::Zero();  ///< of the kinematic error states, in their order
  AlignmentRest rest;
  AlignmentMethod method = AlignmentMethod::kReferenceAttitude;
};

/// What the aligner must know of the R-IMU and the antenna, and when it may be content.
struct InitialAlignmentOptions {
  NavigationProcessNoise reference_noise;  ///< of the R-IMU; its bias sd decides on gyrocompassing
  Eigen::Vector3d r_ba_b_m = Eigen::Vector3d::Zero();  ///< GNSS antenna's lever arm
  double heading_sd_limit_rad = 5.0 * kRadPerDeg;      ///< a heading is good enough below this
  double rest_s = 2.0;                                 ///< least rest for levelling
  double gyrocompass_s_max = 300.0;                    ///< rest is averaged at most this long
};

/// Fed with the samples of R-IMU and GNSS in the order of arrival, it says by stage() what it waits for, and
/// by result() where the filter can start.
class InitialAligner {
 public:
  explicit InitialAligner(const InitialAlignmentOptions& options) noexcept;

  /// Adds one R-IMU sample, not compensated, times strictly rising (others are ignored). After a gap of more
  /// than 0.5 s the alignment starts afresh.
  /// @param true_per_host_second  length of a host second, near 1: rates are integrated over true ones
  void add_imu(HostTime time, const InertialRates& measured, double true_per_host_second = 1.0) noexcept;

  /// Adds one GNSS position of the antenna. At most 0.5 s older than the newest IMU sample.
  /// @param sd_m  NED
  void add_gnss_position(HostTime time, const GeodeticPosition& antenna,
                         const Eigen::Vector3d& sd_m) noexcept;

  /// Adds one GNSS velocity; not required.
  void add_gnss_velocity(HostTime time, const Eigen::Vector3d& v_n_mps,
                         const Eigen::Vector3d& sd_mps) noexcept;

  /// Adds the R-IMU's own attitude; only hand in attitudes whose roll, pitch and heading are valid.
  void add_attitude(HostTime time, const EulerAngles& attitude, const Eigen::Vector3d& sd_rpy_rad) noexcept;

  [[nodiscard]] AlignmentStage stage() const noexcept { return stage_; }
  /// The start, at the newest IMU sample; nullptr before kDone. The aligner runs on, so it stays the newest.
  [[nodiscard]] const InitialNavigation* result() const noexcept;
  /// Sd of the heading as known now; pi when nothing is known. For the log.
  [[nodiscard]] double heading_sd_rad() const noexcept { return heading_sd_rad_; }

 private:
  /// Antenna position and what the IMU felt up to then, at one GNSS epoch.
  struct Node {
    double time_s = 0.0;                                     ///< since origin_time_
    Eigen::Vector3d position_n_m = Eigen::Vector3d::Zero();  ///< antenna, NED about origin_
    Eigen::Vector3d felt_a_m = Eigen::Vector3d::Zero();      ///< as felt_a_m_, for the antenna
    double sd_m = 0.0;
  };
  static constexpr std::size_t kNodes = 240;

  void restart() noexcept;
  void close_block() noexcept;
  void level_and_gyrocompass() noexcept;
  void integrate(const InertialRates& end, double dt_s) noexcept;
  void note_gnss_motion(const Node& node) noexcept;
  void find_heading_in_motion() noexcept;
  void update_stage() noexcept;
  [[nodiscard]] bool find_position_and_velocity(InitialNavigation& out) const noexcept;
  void take_gnss_velocity(InitialNavigation& out) const noexcept;
  [[nodiscard]] Eigen::Matrix3d C_a_n() const noexcept;
  [[nodiscard]] double seconds(HostTime time) const noexcept;
  [[nodiscard]] const Node& node(std::size_t age) const noexcept;  ///< 0 = newest
  [[nodiscard]] std::size_t nodes_held() const noexcept;

  InitialAlignmentOptions options_;
  AlignmentStage stage_ = AlignmentStage::kWaitingForRest;
  InitialNavigation result_;

  // Newest IMU sample.
  bool has_imu_ = false;
  HostTime imu_time_{};
  InertialRates imu_;

  // Blocks of half a second, and the rest that they make up.
  InertialRates block_sum_;
  double block_s_ = 0.0;
  int block_samples_ = 0;
  InertialRates rest_mean_;
  double rest_s_ = 0.0;
  HostTime moving_until_ = HostTime::min();  ///< as GNSS shows it

  // Frame a: level, of arbitrary heading. With the R-IMU's own attitude it is NED itself.
  bool level_ = false;
  Eigen::Matrix3d C_b_a_ = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d C_b_a_at_rest_ = Eigen::Matrix3d::Identity();
  double levelled_s_ = 0.0;                                      ///< time since the rest ended
  double rest_used_s_ = 0.0;                                     ///< length of that rest
  Eigen::Vector3d rest_rate_b_radps_ = Eigen::Vector3d::Zero();  ///< gyro bias and Earth rate together
  Eigen::Vector3d rest_force_b_mps2_ = Eigen::Vector3d::Zero();
  double tilt_sd_rad_ = kPi;
  Eigen::Vector3d a_a_mps2_ = Eigen::Vector3d::Zero();             ///< C_b_a f + g
  Eigen::Vector3d felt_velocity_a_mps_ = Eigen::Vector3d::Zero();  ///< its integral
  Eigen::Vector3d felt_a_m_ = Eigen::Vector3d::Zero();             ///< its second integral

  // GNSS.
  bool has_origin_ = false;
  GeodeticPosition origin_;
  HostTime origin_time_{};
  double gravity_mps2_ = kMps2PerG;
  std::array<Node, kNodes> nodes_;
  std::size_t node_count_ = 0;  ///< ever added since the restart
  bool has_velocity_ = false;
  HostTime velocity_time_{};
  Eigen::Vector3d v_antenna_n_mps_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d v_sd_mps_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d felt_velocity_then_a_mps_ = Eigen::Vector3d::Zero();  ///< of the antenna

  // Heading of frame a, and what the in-motion solution says of its tilt.
  bool heading_known_ = false;
  AlignmentMethod method_ = AlignmentMethod::kInMotion;
  double heading_of_a_rad_ = 0.0;
  double heading_sd_rad_ = kPi;
  Eigen::Vector3d tilt_error_a_rad_ = Eigen::Vector3d::Zero();
};

}  // namespace imuscope
