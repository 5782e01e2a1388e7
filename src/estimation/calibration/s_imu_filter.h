#pragma once

/// One S-IMU on its way through the estimator: its waiting samples, its coarse alignment, its measurement
/// updates and what is published of them. What contradicts them, MountingMonitor sees. Core. Thread: one.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "estimation/alignment/coarse_mounting.h"
#include "estimation/alignment/cross_correlation.h"
#include "estimation/alignment/reference_window.h"
#include "estimation/calibration/estimator.h"
#include "estimation/calibration/event_log.h"
#include "estimation/calibration/filter_core.h"
#include "estimation/calibration/mounting_monitor.h"
#include "estimation/calibration/reference_axes.h"
#include "estimation/calibration/resting_noise.h"
#include "estimation/calibration/update_window.h"

namespace imuscope {

/// Where processed S samples go.
class EpochSink {
 public:
  virtual ~EpochSink() = default;
  virtual void on_epoch(const SImuEpoch& epoch) noexcept = 0;
};

/// What the S-IMUs share in one tick.
struct SImuContext {
  FilterCore& core;
  const ReferenceWindow& window;
  EventLog& log;
  EpochSink& epochs;
  Regime regime;
};

class SImuFilter {
 public:
  SImuFilter(const EstimatorConfig& config, std::size_t index);

  /// Takes a sample into the waiting queue.
  void add(const Sample& sample) noexcept;
  /// The reference's rate, for the coarse time offset.
  void add_reference(HostTime time, double rate_radps) noexcept;
  /// Processes what has its reference. What has none waits for it, and is given up after a while as long as
  /// the mounting is not known.
  void process(SImuContext& context, HostTime cut) noexcept;

  void set_noise(FilterCore& core, const SImuNoise& noise) noexcept;
  /// The reference has shown its noise. C-28.
  void set_reference_noise(FilterCore& core, const WhiteNoise& noise) noexcept;
  void update_output(const FilterCore& core, EventLog& log) noexcept;
  /// The mounting found contradicts what was configured.
  [[nodiscard]] bool contradicts_prior() const noexcept { return monitor_.contradicts_prior(); }
  /// The mounting found lies within a few sd of what is configured for `other`.
  [[nodiscard]] bool fits_prior_of(const SImuConfig& other) const noexcept {
    return calibrating_ && MountingMonitor::fits_prior_of(other, output_);
  }
  [[nodiscard]] const SImuOutput& output() const noexcept { return output_; }
  [[nodiscard]] const SImuConfig& config() const noexcept { return config_; }

 private:
  using Triad = MountingMonitor::Triad;

  void work_off(SImuContext& context, HostTime cut) noexcept;
  [[nodiscard]] bool gives_up(const Sample& sample, HostTime cut) const noexcept;
  /// The reference as the two triads see it.
  struct Seen {
    ReferenceKinematics gyro;
    ReferenceKinematics accel;
  };
  [[nodiscard]] ReferenceResult look(const SImuContext& context, HostTime time, Seen& seen) const noexcept;
  void process_sample(SImuContext& context, const Sample& sample, HostTime valid, Seen b) noexcept;
  void gather(SImuContext& context, const Sample& sample, HostTime valid,
              const ReferenceKinematics& b) noexcept;
  void attempt(SImuContext& context, HostTime valid) noexcept;
  void try_coarse_alignment(SImuContext& context, HostTime now) noexcept;
  void begin(SImuContext& context, HostTime now, const Eigen::Matrix3d& C_b_s,
             const Eigen::Matrix3d& mounting_covariance, double t_d_s, double t_d_sd_s) noexcept;
  /// What was found is worth nothing; what is configured still is.
  void start_again(FilterCore& core) noexcept;
  /// The mounting has changed: all is forgotten that was found of it.
  void look_anew(FilterCore& core, HostTime now) noexcept;
  void predict(FilterCore& core, double dt_s) noexcept;
  /// @param b      as the reference measured it, `t_d_s` after the sample
  void correct(SImuContext& context, Triad triad, const ReferenceKinematics& b, double t_d_s,
               SImuEpoch& epoch) noexcept;
  void update_from_block(SImuContext& context, Triad triad, SImuEpoch& epoch) noexcept;
  [[nodiscard]] LinearisationSpread linearisation_spread(const FilterCore& core, Triad triad) const noexcept;
  /// Variance of one sample's innovation, as the newest update has it. In s.
  [[nodiscard]] Eigen::Vector3d sample_variance(Triad triad, const SImuState& state,
                                                const ReferenceKinematics& b,
                                                const Eigen::Vector3d& plain) const noexcept;
  void restart_windows() noexcept;
  void set_window_noise() noexcept;
  [[nodiscard]] bool mounting_may_have_moved(const FilterCore& core) noexcept;
  /// Mounting and accelerometer triad in the frames of their axes. C-22, C-27.
  void publish_mounting(const FilterCore& core) noexcept;
  void publish_accel_triad(const FilterCore& core, const ReferenceColumns& F) noexcept;
  void precompute_noise() noexcept;

  std::size_t index_;
  SImuConfig config_;
  Duration late_after_;
  double reference_rate_hz_;
  double gate_;              ///< bound of y^2 / S of one axis
  double rate_noise_radps_;  ///< of one R sample
  double force_noise_mps2_;
  double noise_known_to_;  ///< sd of the share of the reference's noise (C-22)
  ReferenceGrade reference_grade_;
  Eigen::Vector3d gyro_scale_by_reference_ = Eigen::Vector3d::Zero();  ///< sd, C-27
  Eigen::Vector3d accel_scale_by_reference_ = Eigen::Vector3d::Zero();
  Duration increment_centre_;  ///< half a sample period
  /// Without bias states (the paper's filter) S biases would pass for R biases and for outliers: the R biases
  /// are then left alone, as in the paper's eq. (5), and nothing is gated.
  bool has_biases_;

  std::vector<Sample> queue_;
  std::size_t queue_head_ = 0;
  std::size_t queue_size_ = 0;
  bool has_last_added_ = false;
  HostTime last_added_{};

  SImuOutput output_;
  bool calibrating_ = false;
  bool prior_in_force_ = true;  ///< false after the mounting has changed
  bool has_last_ = false;
  HostTime last_time_{};

  LiveTimeOffset live_offset_;
  CoarseMountingEstimator coarse_mounting_;
  double coarse_t_d_s_ = 0.0;
  double coarse_t_d_sd_s_ = 0.0;
  HostTime next_attempt_{};

  /// Per regime and triad: R of the filter (inflated) and the model's own variance.
  struct NoiseVariances {
    Eigen::Vector3d inflated;
    Eigen::Vector3d plain;
  };
  std::array<std::array<NoiseVariances, 2>, kRegimeCount> variances_;
  /// Turn-on and slow process as one: C-17.
  std::array<GaussMarkovConfig, 3> gyro_bias_;
  std::array<GaussMarkovConfig, 3> accel_bias_;

  /// Weighted sums over the samples of one update; C-15. They are held against the state when they are
  /// complete, so that nothing is lost where another update moves it meanwhile.
  struct Block {
    double weight = 0.0;
    ReferenceMean b;
    Eigen::Vector3d measured = Eigen::Vector3d::Zero();
    double t_d_s = 0.0;  ///< that the reference was looked up with
    std::array<bool, 3> clipped{};
  };
  struct Windows {
    std::array<Block, 2> blocks;  ///< one falls while the other rises
    std::size_t falling = 0;
    int position = 0;
    Eigen::Vector3d known = Eigen::Vector3d::Zero();  ///< diagonal of H P H', of the newest update
    bool is_known = false;
  };
  std::array<Windows, 2> windows_;
  WindowChoice window_;
  MotionShare motion_;
  /// Mean share of noise in the angular acceleration of the updates that the lever arm was found from, and
  /// how many they are.
  double noise_share_ = 0.0;
  double noise_share_n_ = 0.0;

  std::array<TriadNoise, kRegimeCount> gyro_floor_;  ///< as configured
  std::array<TriadNoise, kRegimeCount> accel_floor_;

  /// All that the published mounting follows from.
  struct PublishedAt {
    std::uint64_t changes = 0;  ///< FilterCore::changes()
    double noise_share = 0.0;
    bool operator==(const PublishedAt&) const = default;
  };
  std::optional<PublishedAt> published_at_;  ///< absent: not yet, with the mounting that it began with

  MountingMonitor monitor_;
  HostTime next_direction_{};
};

}  // namespace imuscope
