#pragma once

/// Watches one S-IMU: whether what it shows goes together with its model, with what is configured of it, with
/// the class of its sensor and with what it showed before, and what may therefore be said of its mounting. It
/// is told innovations and estimates, keeps its own means of them, tells a person of what contradicts, and
/// touches nothing of the filter: whoever asks draws the consequence.
///
/// EQUATIONS.md C-22 (the lever arm that noise takes), C-24, C-25, E-8, E-9, E-19. SI and radians; psi and r
/// in b, everything else in s; times are of validity, on the host's scale. Core: no allocation, no lock,
/// nothing thrown. Thread: one, that of the S-IMU's filter.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "base/time.h"
#include "estimation/calibration/estimator.h"
#include "estimation/calibration/estimator_config.h"
#include "estimation/calibration/event_log.h"
#include "estimation/calibration/filter_core.h"
#include "sample/regime.h"
#include "sample/sample.h"

namespace imuscope {

/// `now` is the newest estimate, as it is published; `config` is that of the S-IMU; events go to `log`.
class MountingMonitor {
 public:
  enum class Triad : std::uint8_t { kGyro, kAccel };

  /// What an estimate began with.
  struct PriorSd {
    std::array<double, 6> psi_r{};  ///< rad, m; meaningless where not estimated
    double t_d_s = 0.0;
  };

  /// One measurement update of one triad as it was held against the model, per axis of s; innovation in rad/s
  /// or m/s^2, variances in their squares.
  struct Update {
    Triad triad = Triad::kGyro;
    Regime regime = Regime::kStatic;
    HostTime time;          ///< of its newest sample
    int samples = 1;        ///< from one update to the next, whose windows overlap by half (C-15)
    double gate = 0.0;      ///< bound of y^2 / S of one axis (E-3)
    Eigen::Vector3d y;      ///< innovation
    Eigen::Vector3d S;      ///< variance as the filter takes it: inflated (C-14) and with noise_factor()
    Eigen::Vector3d plain;  ///< variance of this one update, by the noise as it is configured
    Eigen::Vector3d known;  ///< the state's share of both, diagonal of H P H'
    std::array<bool, 3> clipped{};  ///< left out: the axis was at the end of its range
    std::array<bool, 3> used{};     ///< neither clipped nor gated
  };

  /// What may be said of an estimate.
  struct Verdict {
    std::array<bool, 6> observable{};  ///< by component of (psi, r): see SImuOutput
    bool t_d_observable = false;
    bool is_calibrated = false;  ///< meets its goal, and nothing contradicts that
  };

  /// The direction in (psi, r), each scaled by its prior sd, in which least has been learned.
  struct Weakest {
    std::array<double, 6> direction{};               ///< unit vector
    SImuDirection component = SImuDirection::kPsiX;  ///< its largest
    double relative_sd = 1.0;                        ///< left there, of the prior's
  };

  /// An estimate begins: nothing is known against it, and it has yet to prove itself. What is known of the
  /// device (misfits, priors that are wrong, biases before a silence) stays.
  void begin(const PriorSd& prior) noexcept;
  /// The coarse alignment found no consistent rotation. Should a mounting be found after all, it counts as
  /// contradicted until it has fitted for minutes. E-19.
  void note_poor_alignment() noexcept;
  /// The sensor was silent for `silence_s` and is back at `now`; `before` is its last estimate. E-9.
  void note_return(const SImuOutput& before, HostTime now, double silence_s, const SImuConfig& config,
                   EventLog& log) noexcept;

  /// Of every sample: at rest an accelerometer shows gravity, whatever its mounting.
  /// @param dt_s  since the sample before
  void watch_gravity(const Sample& sample, Regime regime, double dt_s, const SImuConfig& config,
                     EventLog& log) noexcept;
  /// Of every update, after its gate and before it corrects the state: a configured noise that is too small
  /// is told. C-24.
  /// @param config  with the noise that is in force
  void watch_update(const Update& update, const SImuConfig& config, EventLog& log) noexcept;
  /// By how much updates' innovations exceed the configured noise's variance, per axis: factor of R. 1 where
  /// what was seen may be chance. C-24.
  [[nodiscard]] Eigen::Vector3d noise_factor(Triad triad, Regime regime) const noexcept;
  /// Some time after a silence: biases that are not those of before are told. E-9.
  void watch_return(const SImuOutput& now, const SImuConfig& config, EventLog& log) noexcept;
  /// Of every sample of a running estimate, after its updates: a device that is not what is configured is
  /// told (E-19), and a mounting that has changed.
  /// @param layout  a mounting that is not estimated cannot be found anew
  /// @param dt_s    since the sample before
  /// @return the S-IMU sits differently: its estimate is worth nothing any more
  [[nodiscard]] bool watch_mounting(const SImuOutput& now, const SImuLayout& layout, double dt_s,
                                    const SImuConfig& config, EventLog& log) noexcept;
  /// A mounting that contradicts the configured one is told, once. E-8.
  void watch_priors(const SImuOutput& now, const SImuConfig& config, EventLog& log) noexcept;
  /// By how much the imperfections of S-IMU `study` exceed what its class allows: factor of every sd of its
  /// mounting, at least 1. C-25.
  [[nodiscard]] double watch_class(const FilterCore& core, std::size_t study,
                                   const SImuConfig& config) noexcept;
  /// A lever arm of whose sd too much comes from the reference's noise is not called observable. C-22.
  /// @param lost_m  what that noise may have taken of the lever arm, in b
  /// @param sd_m    of the lever arm, as published
  void watch_attenuation(const Eigen::Vector3d& lost_m, const Vector3& sd_m) noexcept;

  /// What may be said of `now`, given all that this has been told: its sd are held against those that it
  /// began with and against its goal. `layout` tells what is estimated at all.
  [[nodiscard]] Verdict judge(const SImuOutput& now, const SImuLayout& layout) const noexcept;
  /// None, with all of the prior's sd left, where not both of psi and r are estimated.
  [[nodiscard]] Weakest weakest_direction(const SImuOutput& now, const SImuLayout& layout) const noexcept;
  /// Its samples fit no mounting: the device is not what is configured. E-19.
  [[nodiscard]] bool misfits() const noexcept { return misfits_; }
  /// The mounting found contradicts what was configured. E-8.
  [[nodiscard]] bool contradicts_prior() const noexcept { return boresight_told_ || lever_arm_told_; }
  /// The mounting found lies within a few sd of what is configured for `other`. E-8.
  [[nodiscard]] static bool fits_prior_of(const SImuConfig& other, const SImuOutput& now) noexcept;

 private:
  void watch_fit(Regime regime, bool gated, HostTime now, double seen_s, const SImuConfig& config,
                 EventLog& log) noexcept;
  void watch_noise(const Update& update, const SImuConfig& config, EventLog& log) noexcept;

  PriorSd prior_;

  Eigen::Vector3d resting_f_mps2_ = Eigen::Vector3d::Zero();  ///< mean force of this standstill
  double resting_s_ = 0.0;
  bool gravity_told_ = false;

  /// What the innovations of a triad say of its configured noise, over a minute of motion.
  struct Contradiction {
    Vector3 nis{1.0, 1.0, 1.0};
    Vector3 seen{};    ///< samples
    Vector3 excess{};  ///< of a sample's variance over the predicted one, SI
    bool is_too_small = false;
    bool is_told = false;
  };
  std::array<Contradiction, 2> contradiction_{};  ///< by triad

  /// What the updates' innovations have been beyond what the configured noise explains.
  struct Surplus {
    Vector3 nis{1.0, 1.0, 1.0};
    Vector3 updates{};
    [[nodiscard]] double factor(std::size_t axis) const noexcept;
    void add(std::size_t axis, double nis_of_update, double updates_max) noexcept;
  };
  std::array<std::array<Surplus, 2>, kRegimeCount> surplus_{};  ///< by regime and triad

  /// Biases before a silence, to be compared with those after it.
  struct BiasesThen {
    HostTime compare_at;
    Vector3 gyro_radps;
    Vector3 sd_gyro_radps;
    Vector3 accel_mps2;
    Vector3 sd_accel_mps2;
  };
  std::optional<BiasesThen> before_silence_;

  std::array<bool, 2> gated_{};  ///< an axis of this triad, in the newest update
  double gated_share_ = 0.0;     ///< over seconds: the mounting changed
  double misfit_share_ = 0.0;    ///< over half a minute of motion: the device is not what is configured
  bool misfits_ = false;
  bool misfit_told_ = false;
  double proof_s_ = 0.0;  ///< motion that this mounting has been held against

  bool boresight_told_ = false;
  bool lever_arm_told_ = false;
  double beyond_class_ = 1.0;  ///< factor of every sd of the mounting
  std::array<bool, 3> lever_arm_attenuated_{};
};

}  // namespace imuscope
