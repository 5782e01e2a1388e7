#pragma once

/// One S-IMU on its way through the estimator: its waiting samples, its coarse alignment, its measurement
/// updates and what is told about them. Core. Thread: one.

#include <cstddef>
#include <optional>
#include <vector>

#include "estimation/alignment/coarse_mounting.h"
#include "estimation/alignment/cross_correlation.h"
#include "estimation/alignment/reference_window.h"
#include "estimation/calibration/estimator.h"
#include "estimation/calibration/event_log.h"
#include "estimation/calibration/filter_core.h"
#include "estimation/calibration/update_window.h"

namespace imuscope {

/// Where processed S samples go.
class EpochSink {
 public:
  virtual ~EpochSink() = default;
  virtual void on_epoch(const StudyEpoch& epoch) noexcept = 0;
};

/// What the S-IMUs share in one tick.
struct StudyContext {
  FilterCore& core;
  const ReferenceWindow& window;
  EventLog& log;
  EpochSink& epochs;
  Regime regime;
};

class StudyFilter {
 public:
  StudyFilter(const EstimatorConfig& config, std::size_t index);

  /// Takes a sample into the waiting queue.
  void add(const Sample& sample) noexcept;
  /// The reference's rate, for the coarse time offset.
  void add_reference(HostTime time, double rate_radps) noexcept;
  /// Processes what has its reference. What has none waits for it, and is given up after a while as long as
  /// the mounting is not known.
  void process(StudyContext& context, HostTime cut) noexcept;

  void set_noise(FilterCore& core, const StudyNoise& noise) noexcept;
  void update_output(const FilterCore& core, EventLog& log) noexcept;
  /// The mounting found contradicts what was configured.
  [[nodiscard]] bool contradicts_prior() const noexcept { return boresight_told_ || lever_arm_told_; }
  /// The mounting found lies within a few sd of what is configured for `other`.
  [[nodiscard]] bool fits_prior_of(const StudyConfig& other) const noexcept;
  [[nodiscard]] const StudyOutput& output() const noexcept { return output_; }
  [[nodiscard]] const StudyConfig& config() const noexcept { return config_; }

 private:
  enum class Triad : std::uint8_t { kGyro, kAccel };

  void work_off(StudyContext& context, HostTime cut) noexcept;
  [[nodiscard]] bool gives_up(const Sample& sample, HostTime cut) const noexcept;
  /// The reference as the two triads see it.
  struct Seen {
    ReferenceKinematics gyro;
    ReferenceKinematics accel;
  };
  [[nodiscard]] ReferenceResult look(const StudyContext& context, HostTime time, Seen& seen) const noexcept;
  void process_sample(StudyContext& context, const Sample& sample, HostTime valid, Seen b) noexcept;
  void gather(StudyContext& context, const Sample& sample, HostTime valid,
              const ReferenceKinematics& b) noexcept;
  void attempt(StudyContext& context, HostTime valid) noexcept;
  void try_coarse_alignment(StudyContext& context, HostTime now) noexcept;
  void begin(StudyContext& context, HostTime now, const Eigen::Matrix3d& C_b_s,
             const Eigen::Matrix3d& mounting_covariance, double t_d_s, double t_d_sd_s) noexcept;
  void predict(FilterCore& core, double dt_s) noexcept;
  /// @param b      as the reference measured it, `t_d_s` after the sample
  void correct(StudyContext& context, Triad triad, const ReferenceKinematics& b, double t_d_s,
               StudyEpoch& epoch) noexcept;
  void update_from_block(StudyContext& context, Triad triad, StudyEpoch& epoch) noexcept;
  [[nodiscard]] LinearisationSpread linearisation_spread(const FilterCore& core, Triad triad) const noexcept;
  /// Variance of one sample's innovation, as the newest update has it. In s.
  [[nodiscard]] Eigen::Vector3d sample_variance(Triad triad, const StudyState& state,
                                                const ReferenceKinematics& b,
                                                const Eigen::Vector3d& plain) const noexcept;
  void restart_windows() noexcept;
  void set_window_noise() noexcept;
  void watch_gravity(StudyContext& context, const Sample& sample, double dt_s) noexcept;
  // E-8, E-9, E-19: what contradicts what was configured or known before.
  void note_return(StudyContext& context, HostTime now, double silence_s) noexcept;
  void watch_return(StudyContext& context, HostTime now) noexcept;
  void watch_priors(EventLog& log) noexcept;
  void watch_mounting(StudyContext& context, HostTime now, double dt_s) noexcept;
  /// Tells of a configured noise that is too small.
  void watch_noise(StudyContext& context, Triad triad, HostTime now) noexcept;
  void watch_fit(StudyContext& context, bool gated, HostTime now, double dt_s) noexcept;
  /// Mounting and accelerometer triad in the frames of their axes. C-22.
  void publish_mounting(const FilterCore& core) noexcept;
  /// By how much the sensor's imperfections exceed what its class allows. C-25.
  [[nodiscard]] double beyond_class(const FilterCore& core) const noexcept;
  /// What may be said of what is published.
  void judge(const FilterCore& core) noexcept;
  void update_weakest_direction(const FilterCore& core) noexcept;
  void precompute_noise() noexcept;

  std::size_t index_;
  StudyConfig config_;
  Duration late_after_;
  double gate_;              ///< bound of y^2 / S of one axis
  double rate_noise_radps_;  ///< of one R sample
  double force_noise_mps2_;
  double reference_scale_sd_;
  double reference_triad_sd_rad_;
  Duration increment_centre_;  ///< half a sample period
  /// Without bias states (the paper's filter) S biases would pass for R biases and for outliers: the R biases
  /// are then left alone, as in the paper's eq. (5), and nothing is gated.
  bool has_biases_;

  std::vector<Sample> queue_;
  std::size_t queue_head_ = 0;
  std::size_t queue_size_ = 0;
  bool has_last_added_ = false;
  HostTime last_added_{};

  StudyOutput output_;
  bool calibrating_ = false;
  bool prior_in_force_ = true;  ///< false after the mounting has changed
  bool has_last_ = false;
  HostTime last_time_{};

  LiveTimeOffset live_offset_;
  CoarseMountingEstimator coarse_mounting_;
  bool offset_known_ = false;
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

  /// Biases before a silence, to be compared with those after it.
  struct BiasesThen {
    HostTime compare_at;
    Vector3 gyro_radps;
    Vector3 sd_gyro_radps;
    Vector3 accel_mps2;
    Vector3 sd_accel_mps2;
  };
  std::optional<BiasesThen> before_silence_;

  Eigen::Vector3d resting_f_ = Eigen::Vector3d::Zero();  ///< mean force of this standstill
  double resting_s_ = 0.0;
  bool gravity_told_ = false;
  bool boresight_told_ = false;
  bool lever_arm_told_ = false;

  /// What the innovations of a triad say of its configured noise, over a minute of motion.
  struct Contradiction {
    Vector3 nis{1.0, 1.0, 1.0};
    Vector3 seen{};    ///< samples
    Vector3 excess{};  ///< of a sample's variance over the predicted one, SI
    bool is_too_small = false;
    bool is_told = false;
  };
  std::array<Contradiction, 2> contradiction_{};
  /// What the updates' innovations have been beyond what the configured noise explains, by regime and triad.
  struct Surplus {
    Vector3 nis{1.0, 1.0, 1.0};
    Vector3 updates{};
    /// Of the noise's variance; 1 where what was seen may be chance.
    [[nodiscard]] double factor(std::size_t axis) const noexcept;
    void add(std::size_t axis, double nis_of_update, double updates_max) noexcept;
  };
  std::array<std::array<Surplus, 2>, kRegimeCount> surplus_{};
  std::array<bool, 2> gated_{};  ///< an axis of this triad, in the newest update
  double gated_share_ = 0.0;     ///< over seconds: the mounting changed
  double misfit_share_ = 0.0;    ///< over half a minute of motion: the device is not what is configured
  bool misfits_ = false;
  bool misfit_told_ = false;
  double proof_s_ = 0.0;  ///< motion that this mounting has been held against
  std::array<bool, 3> lever_arm_attenuated_{};
  double beyond_class_ = 1.0;  ///< factor of every sd of the mounting
  std::array<double, 6> prior_sd_psi_r_{};
  double prior_sd_t_d_ = 0.0;
  HostTime next_direction_{};
};

}  // namespace imuscope
