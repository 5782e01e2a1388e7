#include "estimation/calibration/estimator.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/contracts.h"
#include "estimation/calibration/event_log.h"
#include "estimation/calibration/filter_core.h"
#include "estimation/calibration/finite_imu.h"
#include "estimation/calibration/navigation_filter.h"
#include "estimation/calibration/odometry_filter.h"
#include "estimation/calibration/regime_detector.h"
#include "estimation/calibration/resting_noise.h"
#include "estimation/calibration/s_imu_filter.h"
#include "estimation/calibration/smoother.h"

namespace imuscope {
namespace {

/// At standstill f_z of forward-right-down axes is about -9.8; above this it points elsewhere.
constexpr double kGravityWrong_mps2 = -8.0;
/// And its magnitude, whatever the axes, is gravity's to this.
constexpr double kGravityTolerance_mps2 = 0.5;
/// The covariance's definiteness is looked at this often. K-6.
constexpr Duration kWatchEvery = std::chrono::seconds{1};

void check(const EstimatorConfig& config) {
  IMUSCOPE_EXPECTS(config.studies.size() <= kMaxSImus);
  IMUSCOPE_EXPECTS(config.reference.rate_hz > 0.0);
  IMUSCOPE_EXPECTS(!config.odometry.enabled || config.odometry.rate_hz > 0.0);
  IMUSCOPE_EXPECTS(config.gate_probability > 0.5 && config.gate_probability < 1.0);
  for (const SImuConfig& study : config.studies) {
    IMUSCOPE_EXPECTS(study.rate_hz > 0.0);
    IMUSCOPE_EXPECTS(study.blocks != 0);
    IMUSCOPE_EXPECTS(study.average_samples >= 0 && study.average_samples <= 50);
  }
}

}  // namespace

class Estimator::Impl final : public EpochSink {
 public:
  Impl(const EstimatorConfig& config, HistorySink* history)
      : config_(config),
        history_(history),
        core_(config),
        window_({config.reference.differentiator_points, 1.0 / config.reference.rate_hz}),
        navigation_(config, core_, log_, counters_),
        odometry_(config, core_, navigation_, log_, counters_),
        resting_noise_(config.reference.rate_hz) {
    if (history_ != nullptr) core_.keep_history();
    epochs_.reserve(kEpochsPerTick);
    studies_.reserve(config.studies.size());
    for (std::size_t i = 0; i < config.studies.size(); ++i) studies_.emplace_back(config, i);
  }

  void add(const Sample& sample) noexcept {
    if (sample.kind == SampleKind::kOdometry) {
      if (config_.odometry.enabled && sample.device == config_.odometry.device) {
        if (odometry_.add(sample)) regime_.add_wheel_speed(sample.odometry.speed_mps);
        return;
      }
    } else if (sample.kind == SampleKind::kPulse) {
      navigation_.add_pulse(sample);
      return;
    } else if (sample.kind == SampleKind::kSteering) {
      navigation_.add_steering(sample);
      return;
    } else if (sample.kind == SampleKind::kGnss) {
      if (config_.gnss.enabled && sample.device == config_.gnss.device) {
        navigation_.add_gnss(sample);
        return;
      }
    } else if (sample.device == config_.reference.device) {
      if (sample.kind == SampleKind::kAttitude) {
        navigation_.add_attitude(sample);
      } else {
        add_reference(sample);
      }
      return;
    } else if (sample.kind == SampleKind::kImu) {
      for (SImuFilter& study : studies_) {
        if (study.config().device != sample.device) continue;
        study.add(sample);
        return;
      }
    }
    ++counters_.unknown_device;
  }

  void advance(HostTime cut) noexcept {
    IMUSCOPE_EXPECTS(cut >= last_cut_);
    last_cut_ = cut;
    ++counters_.ticks;
    epochs_.clear();
    SImuContext context{core_, window_, log_, *this, regime_.regime()};
    for (SImuFilter& study : studies_) study.process(context, cut);
    watch_covariance(cut);
    core_.settle();
    hand_out_history();
    navigation_.update_output();
    odometry_.update_output();
    for (SImuFilter& study : studies_) study.update_output(core_, log_);
    watch_swaps(cut);
    counters_.events_lost = log_.lost();
    shown_.take(log_);
  }

  void set_noise(std::size_t study, const SImuNoise& noise) noexcept {
    IMUSCOPE_EXPECTS(study < studies_.size());
    studies_[study].set_noise(core_, noise);
  }

  void on_epoch(const SImuEpoch& epoch) noexcept override {
    if (epochs_.size() == kEpochsPerTick) {
      ++counters_.epochs_lost;
      return;
    }
    epochs_.push_back(epoch);
    epochs_.back().utc = time_scale().at(epoch.time + from_seconds(epoch.t_d_s));
  }

  void set_pc_clock(HostTime time, UtcTime utc) noexcept { navigation_.set_pc_clock(time, utc); }

  [[nodiscard]] const NavigationOutput& navigation() const noexcept { return navigation_.output(); }
  [[nodiscard]] const OdometryOutput& odometry() const noexcept { return odometry_.output(); }
  [[nodiscard]] const TimeScale& time_scale() const noexcept { return navigation_.time_scale(); }
  [[nodiscard]] std::size_t study_count() const noexcept { return studies_.size(); }
  [[nodiscard]] const SImuOutput& study(std::size_t i) const noexcept { return studies_[i].output(); }
  [[nodiscard]] std::span<const SImuEpoch> epochs() const noexcept { return epochs_; }
  [[nodiscard]] std::span<const EstimatorEvent> events() const noexcept { return shown_.events(); }
  [[nodiscard]] const EstimatorCounters& counters() const noexcept { return counters_; }

 private:
  void add_reference(const Sample& sample) noexcept {
    ++counters_.reference_samples;
    if (!is_finite(sample.imu)) {
      ++counters_.reference_not_finite;
      return;
    }
    if (!window_.push(sample)) {
      ++counters_.reference_not_increasing;
      return;
    }
    const double dt_s = has_reference_ ? to_seconds(sample.time - last_reference_) : 0.0;
    if (dt_s > 1.5 / config_.reference.rate_hz) {
      ++counters_.reference_gaps;
      log_.add(event::ReferenceGap{dt_s}, sample.device, sample.time);
    }
    has_reference_ = true;
    last_reference_ = sample.time;
    const Eigen::Vector3d omega = to_eigen(sample.imu.omega_radps);
    regime_.add(omega, to_eigen(sample.imu.f_mps2), dt_s);
    watch_gravity(sample);
    watch_noise(sample, dt_s);
    for (SImuFilter& study : studies_) study.add_reference(sample.time, omega.norm());
    navigation_.add_reference(sample);
    odometry_.process(sample.time, regime_.regime());
  }

  // E-10
  void hand_out_history() noexcept {
    if (history_ == nullptr || !has_reference_ || last_reference_ < next_history_) return;
    next_history_ = last_reference_ + history_->interval();
    std::array<bool, kMaxSImus> calibrating{};
    for (std::size_t i = 0; i < studies_.size(); ++i)
      calibrating[i] = has_estimate(studies_[i].output().status);
    history_->on_history(
        {last_reference_, navigation_.navigating(), calibrating, core_, core_.accumulated()});
    core_.restart_accumulation();
  }

  // C-28
  void watch_noise(const Sample& sample, double dt_s) noexcept {
    if (config_.reference.is_known) return;
    if (!resting_noise_.add(to_eigen(sample.imu.omega_radps), to_eigen(sample.imu.f_mps2), dt_s)) return;
    const WhiteNoise& seen = *resting_noise_.seen();
    for (SImuFilter& study : studies_) study.set_reference_noise(core_, seen);
    if (std::exchange(noise_told_, true)) return;
    log_.add(event::ReferenceNoiseSeen{seen.gyro_radps_per_sqrt_hz, seen.accel_mps2_per_sqrt_hz},
             sample.device, sample.time);
  }

  void watch_gravity(const Sample& sample) noexcept {
    if (gravity_told_ || regime_.regime() != Regime::kStatic) return;
    const double magnitude = regime_.mean_f_mps2().norm();
    const bool is_gravity = std::abs(magnitude - kNominalGravity_mps2) < kGravityTolerance_mps2;
    if (is_gravity && regime_.mean_f_mps2().z() < kGravityWrong_mps2) return;
    gravity_told_ = true;
    if (is_gravity) {
      log_.add(event::ReferenceGravityWrong{regime_.mean_f_mps2().z()}, sample.device, sample.time);
    } else {
      log_.add(event::GravityMagnitudeWrong{magnitude}, sample.device, sample.time);
    }
  }

  void watch_swaps(HostTime now) noexcept {
    for (std::size_t i = 0; i < studies_.size(); ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        const bool told = swap_told_[i] || swap_told_[j];
        if (told || !studies_[i].contradicts_prior() || !studies_[j].contradicts_prior()) continue;
        // E-8: each fits the other's prior
        if (!studies_[i].fits_prior_of(studies_[j].config()) ||
            !studies_[j].fits_prior_of(studies_[i].config()))
          continue;
        swap_told_[i] = swap_told_[j] = true;
        log_.add(event::SImusSwapped{studies_[i].config().device}, studies_[j].config().device, now);
      }
    }
  }

  void watch_covariance(HostTime time) noexcept {
    std::size_t state = 0;
    std::size_t repaired = core_.repair(state);
    if (repaired == 0 && time >= next_watch_) {
      next_watch_ = time + kWatchEvery;
      if (const auto bad = core_.covariance().first_bad_state()) {
        state = *bad;
        core_.repair_state(state);
        repaired = 1;
      }
    }
    if (repaired == 0) return;
    counters_.covariance_repairs += repaired;
    log_.add(event::CovarianceRepaired{state}, config_.reference.device, time);
  }

  EstimatorConfig config_;
  HistorySink* history_;
  HostTime next_history_{HostTime::min()};
  FilterCore core_;
  HostTime next_watch_{HostTime::min()};
  std::array<bool, kMaxSImus> swap_told_{};
  ReferenceWindow window_;
  EventLog log_;
  EventLog shown_;
  EstimatorCounters counters_;
  NavigationFilter navigation_;
  OdometryFilter odometry_;
  RegimeDetector regime_;
  RestingNoise resting_noise_;
  bool noise_told_ = false;
  std::vector<SImuFilter> studies_;
  std::vector<SImuEpoch> epochs_;
  HostTime last_cut_{HostTime::min()};
  bool has_reference_ = false;
  HostTime last_reference_{};
  bool gravity_told_ = false;
};

Estimator::Estimator(const EstimatorConfig& config, HistorySink* history) {
  check(config);
  impl_ = std::make_unique<Impl>(config, history);
}
Estimator::~Estimator() = default;
Estimator::Estimator(Estimator&&) noexcept = default;
Estimator& Estimator::operator=(Estimator&&) noexcept = default;

void Estimator::add(const Sample& sample) noexcept { impl_->add(sample); }
void Estimator::advance(HostTime cut) noexcept { impl_->advance(cut); }
void Estimator::set_noise(std::size_t study, const SImuNoise& noise) noexcept {
  impl_->set_noise(study, noise);
}
void Estimator::set_pc_clock(HostTime time, UtcTime utc) noexcept { impl_->set_pc_clock(time, utc); }
const TimeScale& Estimator::time_scale() const noexcept { return impl_->time_scale(); }
const NavigationOutput& Estimator::navigation() const noexcept { return impl_->navigation(); }
const OdometryOutput& Estimator::odometry() const noexcept { return impl_->odometry(); }
std::size_t Estimator::study_count() const noexcept { return impl_->study_count(); }
const SImuOutput& Estimator::study(std::size_t index) const noexcept { return impl_->study(index); }
std::span<const SImuEpoch> Estimator::epochs() const noexcept { return impl_->epochs(); }
std::span<const EstimatorEvent> Estimator::events() const noexcept { return impl_->events(); }
const EstimatorCounters& Estimator::counters() const noexcept { return impl_->counters(); }

}  // namespace imuscope
