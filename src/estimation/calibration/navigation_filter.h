#pragma once

/// R-IMU/GNSS navigation inside the common filter: start, propagation, gaps, delayed GNSS solutions.
///
/// A GNSS solution is applied at its time of validity: a ring of past states with the transitions between
/// them gives the state then, corrected with what has been learned since, and carries the measurement matrix
/// to the present, H_eff = H Phi^-1 (E-5; the process noise during the delay is left out). Core. Thread: one.

#include <cstddef>
#include <optional>
#include <vector>

#include "estimation/calibration/arm_rate.h"
#include "estimation/calibration/estimator.h"
#include "estimation/calibration/event_log.h"
#include "estimation/calibration/filter_core.h"
#include "estimation/navigation/gnss_gate.h"
#include "estimation/navigation/gnss_measurement.h"
#include "estimation/navigation/initial_alignment.h"
#include "sample/utc_scale.h"

namespace imuscope {

class NavigationFilter {
 public:
  NavigationFilter(const EstimatorConfig& config, FilterCore& core, EventLog& log,
                   EstimatorCounters& counters);

  /// One R sample, finite and newer than the last.
  void add_reference(const Sample& sample) noexcept;
  void add_attitude(const Sample& sample) noexcept;
  void add_gnss(const Sample& sample) noexcept;
  void add_pulse(const Sample& sample) noexcept;
  void add_steering(const Sample& sample) noexcept;

  /// A past epoch seen from the present.
  struct Delayed {
    NavigationState state;
    InertialRates measured;  ///< the rate, where the gyros are noisy, a mean; standing, the bias (E-29)
    NavigationErrorCovariance back;  ///< Phi^-1: error then = back * error now
    double rate_share;               ///< of the gyros' reading in that rate: 1, or 0
    double sd_rate_radps;            ///< noise of that rate
    /// The rate by which an arm swings that is learned from its swing (E-29), as measured.
    Eigen::Vector3d swing_omega_ib_b_radps;
    Eigen::Vector3d swing_share;  ///< of the gyros' reading in it, each axis
    double sd_swing_radps;        ///< what it leaves unknown of the true rate
  };
  enum class Lookup : std::uint8_t { kFound, kTooNew, kTooOld };
  /// The state at a past time, with everything learned since. E-5.
  [[nodiscard]] Lookup look_back(HostTime time, Delayed& out) const noexcept;

  [[nodiscard]] bool navigating() const noexcept { return output_.status == NavigationStatus::kNavigating; }
  /// Writes the newest state and its sd into output().
  void update_output() noexcept;
  [[nodiscard]] const NavigationOutput& output() const noexcept { return output_; }
  void set_pc_clock(HostTime time, UtcTime utc) noexcept { utc_scale_.set_pc_clock(time, utc); }
  /// The seconds that rates are integrated over.
  [[nodiscard]] const TimeScale& time_scale() const noexcept { return utc_scale_.scale(); }

 private:
  /// State at one R epoch, and the transition that led to it from the epoch before.
  struct PastEpoch {
    HostTime time;
    UtcTime utc;
    bool has_utc;
    NavigationState state;
    InertialRates measured;
    NavigationErrorVector injected;  ///< after `state` was written, until the next epoch
    NavigationDynamics kinematic_rows;
    double gyro_bias_decay;
    double accel_bias_decay;
  };

  [[nodiscard]] double interval_to(const Sample& sample) noexcept;
  void carry_over_interval(const InertialRates& measured, bool is_mean, double dt_s) noexcept;
  void predict(const InertialRates& rates, double dt_s, double extra_rate_noise) noexcept;
  void predict_biases_only(double dt_s) noexcept;
  void remember(const Sample& sample, const InertialRates& measured) noexcept;
  [[nodiscard]] Eigen::Vector3d mean_rate(std::size_t centre, std::size_t half_width) const noexcept;
  [[nodiscard]] InertialRates measured_between(std::size_t k, double share_of_newer) const noexcept;
  void set_arm_rate(std::size_t k, double share_of_newer, Delayed& out) const noexcept;
  void try_start(const Sample& sample) noexcept;
  void start(const NavigationState& state, const NavigationErrorVector& sd, InitialisationMethod method,
             HostTime time) noexcept;
  void stop(HostTime time, double gap_s) noexcept;
  bool apply_gnss(const Sample& sample) noexcept;
  /// What brings a solution to the R-IMU's time, and so what its latency is of.
  enum class Meeting : std::uint8_t { kNone, kTags, kPulses, kStamps };
  struct Met {
    HostTime time;
    Meeting by;
  };
  [[nodiscard]] Met met(const Sample& gnss) const noexcept;
  void carry_latency(Meeting by, HostTime time) noexcept;
  void tell_latency() noexcept;
  [[nodiscard]] HostTime plausible_time(const Sample& gnss, HostTime time) noexcept;
  bool apply(GnssGate& gate, const GnssInnovation& measured, const AntennaMatrix& of_antenna,
             const NavigationErrorCovariance& back, const Eigen::Vector3d& sd, HostTime time, Vector3& nis,
             CovarianceKernel::Considered considered = {}) noexcept;
  void correlate_with_antenna() noexcept;
  void take_rest(const AlignmentRest& rest, InitialisationMethod method) noexcept;
  void watch_consistency(HostTime time) noexcept;
  void widen_for_reacquisition(const Eigen::Vector3d& innovation) noexcept;
  [[nodiscard]] PastEpoch& past(std::size_t back) noexcept;  ///< 0 = newest
  [[nodiscard]] const PastEpoch& past(std::size_t back) const noexcept;

  static constexpr std::size_t kPendingGnss = 8;

  ReferenceConfig reference_;
  GnssConfig gnss_;
  NavigationConfig navigation_;
  NavigationProcessNoise noise_;
  FilterCore& core_;
  EventLog& log_;
  EstimatorCounters& counters_;
  ArmRate arm_rate_;
  InitialAligner aligner_;
  GnssGate position_gate_;
  GnssGate velocity_gate_;
  double improbable_share_ = 0.0;  ///< of the positions of the last minute
  double watched_s_ = 0.0;
  HostTime last_position_{};
  bool inconsistent_told_ = false;
  NavigationOutput output_;

  bool has_last_ = false;
  HostTime last_time_{};
  UtcScale utc_scale_;
  double last_seconds_ = 0.0;  ///< of utc_scale_ at last_time_
  std::int64_t last_counter_ = 0;
  UtcTime last_utc_{};
  bool last_has_utc_ = false;
  Meeting meeting_ = Meeting::kNone;
  HostTime latency_time_{};           ///< up to which the latency has wandered
  std::optional<Duration> gnss_lag_;  ///< of the last solution that was not near a UTC midnight
  InertialRates last_;
  InertialRates manoeuvre_;  ///< compensated rates, vibration taken off (N-27)

  std::vector<PastEpoch> past_;
  std::size_t past_head_ = 0;
  std::size_t past_size_ = 0;
  std::array<Sample, kPendingGnss> pending_{};
  std::size_t pending_size_ = 0;
  bool streak_ = false;
  HostTime streak_start_{};
};

}  // namespace imuscope
