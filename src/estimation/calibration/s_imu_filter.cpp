#include "estimation/calibration/s_imu_filter.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "estimation/calibration/axis_gate.h"
#include "estimation/calibration/finite_imu.h"
#include "estimation/navigation/so3.h"

namespace imuscope {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// A silence of this length makes the biases uncertain again: the sensor may have been off.
constexpr double kReturnAfter_s = 5.0;
/// Samples further apart are not averaged into one update.
constexpr double kBlockGap_s = 0.1;
/// The reference's noise is known to this share: what it takes of the lever arm is put right as far as that.
constexpr double kNoiseKnown = 0.1;
/// A reference that is noisier than it was taken for by this has had its noise taken for motion.
constexpr double kMuchNoisier = 1.5;
/// Unless it was no more than this share of the angular acceleration's power: no window is too noisy then (C-15).
constexpr double kNoiseMatters = 0.03;
/// What a low-pass of its own, of 40 Hz as data sheets have it, takes of the motion that a sensor is to show:
/// f^2 / (2 f_c^2), and vehicles as wholes move at 1.25 Hz. It looks like a scale.
constexpr double kLowPass_hz = 40.0;
constexpr double kVehicle_hz = 1.25;
constexpr double kLowPassShare = 0.5 * (kVehicle_hz / kLowPass_hz) * (kVehicle_hz / kLowPass_hz);
/// Noise of the angular acceleration in neighbouring windows has the correlation -1/2: what changes from one
/// to the next, as the columns of the time offset do, sees up to twice the variance.
constexpr double kSlopeCorrelation = 2.0;
/// A window that began in the middle, as after a gap, is none.
constexpr double kWholeWindow = 0.9;
/// NIS is averaged over this time.
constexpr double kNisMean_s = 10.0;
/// The coarse alignment is tried this often.
constexpr Duration kCoarseEvery = std::chrono::seconds{1};
/// A coarse offset that moves by more than this makes the gathered pairs useless.
constexpr double kCoarseOffsetStable_s = 0.02;
/// The cross-correlation's own sd is optimistic where signals are smooth.
constexpr double kCoarseOffsetSdFactor = 3.0;
constexpr Duration kDirectionEvery = std::chrono::seconds{1};

/// theta of C-22 is this times (e_yz, e_xz, e_xy).
const Vector3d kLeanOfAxes(1.0, -1.0, 1.0);

/// 3 x 3 block of the covariance; zero where either state is absent.
Matrix3d block_of(const CovarianceKernel& P, std::size_t row, std::size_t column) {
  Matrix3d out = Matrix3d::Zero();
  if (row == SImuLayout::kAbsent || column == SImuLayout::kAbsent) return out;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j)
      out(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = P(row + i, column + j);
  }
  return out;
}

using ThreeRows = Eigen::Matrix<double, 3, kAxesErrors>;

AffectedCovariance affected_by_axes(const CovarianceKernel& P, const SImuLayout& layout) {
  const std::array<std::size_t, affected::kSize / 3> blocks = {
      layout.psi,         layout.r,          layout.gyro_scale,     layout.gyro_axes,
      layout.accel_scale, layout.accel_axes, layout.accel_boresight};
  AffectedCovariance out;
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    for (std::size_t j = 0; j < blocks.size(); ++j)
      out.block<3, 3>(3 * static_cast<Eigen::Index>(i), 3 * static_cast<Eigen::Index>(j)) =
          block_of(P, blocks[i], blocks[j]);
  }
  return out;
}

/// Zero where a state is absent.
TakenUpSd prior_of_axes(const SImuConfig& config, const SImuLayout& layout) {
  const auto known = [](std::size_t first, const Vector3d& sd) {
    return first == SImuLayout::kAbsent ? Vector3d(Vector3d::Zero()) : sd;
  };
  const Vector3d leans = Vector3d::Constant(config.prior_axes_sd_rad);
  TakenUpSd sd;
  sd << known(layout.gyro_scale, to_eigen(config.prior_gyro_scale_sd)), known(layout.gyro_axes, leans),
      known(layout.accel_scale, to_eigen(config.prior_accel_scale_sd)), known(layout.accel_axes, leans),
      known(layout.accel_boresight, to_eigen(config.prior_accel_boresight_sd_rad));
  return sd;
}

/// C-17: one process for a constant and a wandering part: the variance of both, and as fast at first as the
/// wandering one.
std::array<GaussMarkovConfig, 3> with_turn_on(const std::array<GaussMarkovConfig, 3>& slow,
                                              const Vector3& turn_on_sd) {
  std::array<GaussMarkovConfig, 3> whole = slow;
  for (std::size_t i = 0; i < 3; ++i) {
    const double variance = slow[i].sd * slow[i].sd + turn_on_sd[i] * turn_on_sd[i];
    whole[i].sd = std::sqrt(variance);
    whole[i].time_constant_s = slow[i].sd > 0.0
                                   ? slow[i].time_constant_s * variance / (slow[i].sd * slow[i].sd)
                                   : std::numeric_limits<double>::infinity();
  }
  return whole;
}

/// What the sensor's class asks of its mounting: the noise of motion, its largest axis.
SensorQuality quality_of(const SImuConfig& config) {
  constexpr auto kMoving = static_cast<std::size_t>(Regime::kDynamic);
  const double per_sqrt_hz = 1.0 / std::sqrt(config.rate_hz);
  SensorQuality quality;
  quality.gyro_white_radps_per_sqrt_hz =
      *std::ranges::max_element(config.noise.gyro[kMoving].white_sd) * per_sqrt_hz;
  quality.accel_white_mps2_per_sqrt_hz =
      *std::ranges::max_element(config.noise.accel[kMoving].white_sd) * per_sqrt_hz;
  if ((config.blocks & kGyroAxesBlock) != 0) quality.axes_sd_rad = config.prior_axes_sd_rad;
  if ((config.blocks & kAccelPlacesBlock) != 0) quality.places_sd_m = config.prior_place_sd_m;
  return quality;
}

}  // namespace

SImuFilter::SImuFilter(const EstimatorConfig& config, std::size_t index)
    : index_(index),
      config_(config.studies[index]),
      late_after_(config.late_after),
      reference_rate_hz_(config.reference.rate_hz),
      gate_(axis_gate(config.gate_probability)),
      rate_noise_radps_((config.reference.is_known ? config.reference.gyro_white_radps_per_sqrt_hz
                                                   : kIndustrialGyroWhite_radps_per_sqrt_hz) *
                        std::sqrt(config.reference.rate_hz)),
      force_noise_mps2_(config.reference.accel_white_mps2_per_sqrt_hz * std::sqrt(config.reference.rate_hz)),
      noise_known_to_(config.reference.is_known ? kNoiseKnown : 1.0),
      reference_grade_(config.reference.grade),
      increment_centre_(from_seconds(0.5 / config_.rate_hz)),
      has_biases_((config_.blocks & kBiasSImuBlocks) == kBiasSImuBlocks),
      queue_(waiting_samples_capacity(config_.rate_hz)),
      window_({config.reference.differentiator_points, 1.0 / config.reference.rate_hz}, config_.rate_hz),
      gyro_floor_(config_.noise.gyro),
      accel_floor_(config_.noise.accel) {
  // The paper's filter takes every sample by itself.
  window_.fix(has_biases_ ? config_.average_samples : std::max(1, config_.average_samples));
  set_window_noise();
  precompute_noise();
}

void SImuFilter::set_window_noise() noexcept {
  motion_.set_noise(rate_noise_radps_, force_noise_mps2_, window_.now().gains);
}

// C-28
void SImuFilter::set_reference_noise(FilterCore& core, const WhiteNoise& noise) noexcept {
  noise_known_to_ = std::max(kNoiseKnown, noise.known_to);
  const double per_sample = std::sqrt(reference_rate_hz_);
  const double rate_noise_radps = noise.gyro_radps_per_sqrt_hz * per_sample;
  const double ratio = rate_noise_radps / rate_noise_radps_;
  if (std::abs(ratio * ratio - 1.0) < kNoiseKnown) return;
  rate_noise_radps_ = rate_noise_radps;
  force_noise_mps2_ = noise.accel_mps2_per_sqrt_hz * per_sample;
  reference_grade_ = reference_grade(noise.gyro_radps_per_sqrt_hz);
  published_at_.reset();
  set_window_noise();
  noise_share_ = motion_.noise_in_rate_slope();
  noise_share_n_ = 1.0;
  const bool mattered = noise_share_ > kNoiseMatters;
  if (ratio > 1.0 && !mattered) return;
  // Powers of motion were taken less the former noise.
  motion_.clear();
  set_window_noise();
  noise_share_ = noise_share_n_ = 0.0;
  if (calibrating_ && ratio > kMuchNoisier) start_again(core);
}

void SImuFilter::restart_windows() noexcept {
  for (Windows& windows : windows_) {
    windows.blocks = {};
    windows.position = 0;
  }
}

void SImuFilter::precompute_noise() noexcept {
  gyro_bias_ = with_turn_on(config_.noise.gyro_bias, config_.turn_on_gyro_sd_radps);
  accel_bias_ = with_turn_on(config_.noise.accel_bias, config_.turn_on_accel_sd_mps2);
  const double dt_s = 1.0 / config_.rate_hz;
  for (std::size_t regime = 0; regime < kRegimeCount; ++regime) {
    for (const Triad triad : {Triad::kGyro, Triad::kAccel}) {
      const TriadNoise& noise =
          triad == Triad::kGyro ? config_.noise.gyro[regime] : config_.noise.accel[regime];
      NoiseVariances& out = variances_[regime][static_cast<std::size_t>(triad)];
      for (std::size_t i = 0; i < 3; ++i) {
        const auto k = static_cast<Eigen::Index>(i);
        // C-14: of the filter's R, and of NIS
        out.inflated(k) =
            inflated_variance(noise.white_sd[i], noise.fast_sd[i], noise.fast_time_constant_s[i], dt_s);
        const double fast = noise.fast_time_constant_s[i] > 0.0 ? noise.fast_sd[i] : 0.0;
        out.plain(k) = noise.white_sd[i] * noise.white_sd[i] + fast * fast;
      }
    }
  }
}

void SImuFilter::add(const Sample& sample) noexcept {
  SImuCounters& counters = output_.counters;
  ++counters.samples;
  if (!is_finite(sample.imu)) {
    ++counters.not_finite;
    return;
  }
  if (has_last_added_ && sample.time <= last_added_) {
    ++counters.not_increasing;
    return;
  }
  if (queue_size_ == queue_.size()) {
    ++counters.refused_full;
    return;
  }
  has_last_added_ = true;
  last_added_ = sample.time;
  queue_[(queue_head_ + queue_size_++) % queue_.size()] = sample;
}

void SImuFilter::add_reference(HostTime time, double rate_radps) noexcept {
  if (!calibrating_) live_offset_.add_reference(time, rate_radps);
}

bool SImuFilter::gives_up(const Sample& sample, HostTime cut) const noexcept {
  // A reference whose line stands still has its samples later: nothing is lost for it.
  if (calibrating_) return false;
  // A sensor that runs ahead (t_d > 0) is expected to wait for t_d.
  const Duration ahead = std::max(Duration{0}, from_seconds(output_.t_d_s));
  return cut > std::max(sample.arrival, sample.time + ahead) + late_after_;
}

void SImuFilter::process(SImuContext& context, HostTime cut) noexcept {
  work_off(context, cut);
  output_.counters.waiting = queue_size_;
}

void SImuFilter::work_off(SImuContext& context, HostTime cut) noexcept {
  if (!calibrating_ && output_.status == CalibrationStatus::kWaiting && queue_size_ > 0) {
    output_.status = CalibrationStatus::kCoarse;
    const bool knows_mounting = config_.prior_C_b_s && prior_in_force_;
    if (knows_mounting && config_.prior_t_d_s) {
      begin(context, queue_[queue_head_].time, to_eigen(*config_.prior_C_b_s), Matrix3d::Zero(),
            *config_.prior_t_d_s, config_.prior_t_d_sd_s);
    } else {
      coarse_t_d_s_ = config_.prior_t_d_s.value_or(0.0);
      coarse_t_d_sd_s_ = config_.prior_t_d_sd_s;
      next_attempt_ = queue_[queue_head_].time + kCoarseEvery;
    }
  }
  while (queue_size_ > 0) {
    const Sample& sample = queue_[queue_head_];
    const bool is_mean = (sample.imu.flags & kIsIncrement) != 0;
    const HostTime valid = is_mean ? sample.time - increment_centre_ : sample.time;
    const double t_d_s = calibrating_ ? context.core.study(index_).t_d_s : coarse_t_d_s_;
    output_.t_d_s = t_d_s;
    // Before the reference is asked: a coarse offset that points outside its window must be able to heal.
    if (!calibrating_) live_offset_.add_study(valid, to_eigen(sample.imu.omega_radps).norm());
    Seen b;
    switch (look(context, valid + from_seconds(t_d_s), b)) {
      case ReferenceResult::kTooNew:
        // E-2: its window is not complete yet.
        if (!gives_up(sample, cut)) return;
        ++output_.counters.late;
        break;
      case ReferenceResult::kTooOld:
      case ReferenceResult::kGap:
        ++output_.counters.no_reference;
        if (!calibrating_) attempt(context, valid);
        break;
      case ReferenceResult::kOk:
        process_sample(context, sample, valid, b);
        break;
    }
    queue_head_ = (queue_head_ + 1) % queue_.size();
    --queue_size_;
  }
}

ReferenceResult SImuFilter::look(const SImuContext& context, HostTime time, Seen& seen) const noexcept {
  // A coarse offset that is wrong by seconds has to be found out.
  constexpr Duration kCoarsePast =
      std::chrono::milliseconds(static_cast<std::int64_t>(1e3 * kReferencePast_s));
  if (!calibrating_ && context.window.newest_sample() > HostTime::min() &&
      time < context.window.newest_sample() - kCoarsePast)
    return ReferenceResult::kTooOld;
  const ReferenceResult result = context.window.evaluate(time, seen.gyro);
  seen.accel = seen.gyro;
  const bool apart = calibrating_ && context.core.layout(index_).accel_t_d != SImuLayout::kAbsent;
  if (result != ReferenceResult::kOk || !apart) return result;
  return context.window.evaluate(time + from_seconds(context.core.study(index_).accel_t_d_s), seen.accel);
}

void SImuFilter::process_sample(SImuContext& context, const Sample& sample, HostTime valid,
                                Seen seen) noexcept {
  FilterCore& core = context.core;
  const double dt_s = has_last_ ? to_seconds(valid - last_time_) : 0.0;
  if (dt_s > kBlockGap_s) restart_windows();
  // E-9: after a silence
  if (has_last_ && dt_s > kReturnAfter_s && calibrating_) {
    for (std::size_t i = 0; i < 3; ++i) {
      const SImuLayout& layout = core.layout(index_);
      if (layout.gyro_bias != SImuLayout::kAbsent)
        core.predict_state(layout.gyro_bias + i, 1.0,
                           config_.turn_on_gyro_sd_radps[i] * config_.turn_on_gyro_sd_radps[i]);
      if (layout.accel_bias != SImuLayout::kAbsent)
        core.predict_state(layout.accel_bias + i, 1.0,
                           config_.turn_on_accel_sd_mps2[i] * config_.turn_on_accel_sd_mps2[i]);
    }
    monitor_.note_return(output_, valid, dt_s, config_, context.log);
  }
  has_last_ = true;
  last_time_ = valid;
  output_.time = valid;
  output_.regime = context.regime;
  monitor_.watch_gravity(sample, context.regime, dt_s, config_, context.log);
  if (calibrating_) predict(core, dt_s);

  const Seen as_measured = seen;
  for (ReferenceKinematics* b : {&seen.gyro, &seen.accel}) {
    b->omega_radps -= core.reference_gyro_bias_radps();
    b->f_mps2 -= core.reference_accel_bias_mps2();
  }
  const ReferenceKinematics& b = seen.gyro;

  SImuEpoch epoch;
  epoch.study = index_;
  epoch.time = valid;
  epoch.t_d_s = output_.t_d_s;
  epoch.sample = sample.imu;
  epoch.omega_ib_b_radps = to_array(b.omega_radps);
  epoch.omega_dot_ib_b_radps2 = to_array(b.omega_dot_radps2);
  epoch.omega_ddot_ib_b_radps3 = to_array(b.omega_ddot_radps3);
  epoch.f_b_mps2 = to_array(b.f_mps2);
  epoch.f_dot_b_mps3 = to_array(b.f_dot_mps3);
  epoch.reference_gyro_bias_radps = to_array(core.reference_gyro_bias_radps());
  epoch.reference_accel_bias_mps2 = to_array(core.reference_accel_bias_mps2());
  const SImuState& now = core.study(index_);
  epoch.C_b_s = to_array(now.C_b_s);
  epoch.r_bs_b_m = to_array(now.r_bs_b_m);
  epoch.regime = context.regime;
  epoch.calibrating = calibrating_;
  if (calibrating_) {
    const double accel_t_d_s = epoch.t_d_s + now.accel_t_d_s;
    correct(context, Triad::kGyro, as_measured.gyro, epoch.t_d_s, epoch);
    correct(context, Triad::kAccel, as_measured.accel, accel_t_d_s, epoch);
    ++output_.counters.used;
    context.epochs.on_epoch(epoch);
    if (has_biases_) monitor_.watch_return(output_, config_, context.log);
    if (monitor_.watch_mounting(output_, core.layout(index_), dt_s, config_, context.log))
      look_anew(core, valid);
  } else {
    context.epochs.on_epoch(epoch);
    gather(context, sample, valid, b);
  }
}

void SImuFilter::gather(SImuContext& context, const Sample& sample, HostTime valid,
                        const ReferenceKinematics& b) noexcept {
  coarse_mounting_.add(b.omega_radps, b.f_mps2, to_eigen(sample.imu.omega_radps),
                       to_eigen(sample.imu.f_mps2));
  attempt(context, valid);
}

void SImuFilter::attempt(SImuContext& context, HostTime valid) noexcept {
  if (valid < next_attempt_) return;
  next_attempt_ = valid + kCoarseEvery;
  try_coarse_alignment(context, valid);
}

void SImuFilter::try_coarse_alignment(SImuContext& context, HostTime now) noexcept {
  ++output_.counters.coarse_attempts;
  if (!config_.prior_t_d_s || !prior_in_force_) {
    TimeOffset found;
    if (!live_offset_.estimate(found)) return;
    const bool moved = std::abs(found.offset_s - coarse_t_d_s_) > kCoarseOffsetStable_s;
    coarse_t_d_s_ = found.offset_s;
    coarse_t_d_sd_s_ = std::max(config_.prior_t_d_sd_s, kCoarseOffsetSdFactor * found.sd_s);
    if (moved) {
      coarse_mounting_.clear();
      return;
    }
  }
  if (config_.prior_C_b_s && prior_in_force_) {
    begin(context, now, to_eigen(*config_.prior_C_b_s), Matrix3d::Zero(), coarse_t_d_s_, coarse_t_d_sd_s_);
    return;
  }
  CoarseMounting mounting;
  const MountingResult result = coarse_mounting_.solve(mounting);
  if (result == MountingResult::kOk) {
    begin(context, now, mounting.C_b_s, mounting.covariance_rad2, coarse_t_d_s_, coarse_t_d_sd_s_);
    context.log.add(event::CoarseAlignmentDone{std::sqrt(mounting.covariance_rad2.trace())}, config_.device,
                    now);
  } else if (result == MountingResult::kInconsistent) {
    context.log.add(event::CoarseAlignmentPoor{mounting.rate_correlation}, config_.device, now);
    coarse_mounting_.clear();
    monitor_.note_poor_alignment();
  }
}

void SImuFilter::begin(SImuContext& context, HostTime now, const Matrix3d& C_b_s,
                       const Matrix3d& mounting_covariance, double t_d_s, double t_d_sd_s) noexcept {
  FilterCore& core = context.core;
  reset_to_prior(core, index_, config_);
  SImuState& state = core.study(index_);
  state.C_b_s = reorthonormalized(C_b_s);
  state.t_d_s = t_d_s;
  const SImuLayout& layout = core.layout(index_);
  CovarianceKernel& P = core.covariance();
  if (layout.psi != SImuLayout::kAbsent) {
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = i; j < 3; ++j) {
        const double prior =
            i == j ? config_.prior_boresight_sd_rad[i] * config_.prior_boresight_sd_rad[i] : 0.0;
        P.set(layout.psi + i, layout.psi + j,
              prior + mounting_covariance(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)));
      }
    }
  }
  if (layout.t_d != SImuLayout::kAbsent) core.reset_state(layout.t_d, t_d_sd_s * t_d_sd_s);
  output_.C_prior = to_array(state.C_b_s);
  MountingMonitor::PriorSd prior{.psi_r = {}, .t_d_s = t_d_sd_s};
  for (std::size_t i = 0; i < 3; ++i) {
    prior.psi_r[i] = core.sd(layout.psi == SImuLayout::kAbsent ? layout.psi : layout.psi + i);
    prior.psi_r[i + 3] = core.sd(layout.r == SImuLayout::kAbsent ? layout.r : layout.r + i);
  }
  monitor_.begin(prior);
  output_.goal = goal_of(quality_of(config_));
  output_.nis_gyro.fill(1.0);
  output_.nis_accel.fill(1.0);
  output_.status = CalibrationStatus::kConverging;
  windows_ = {};
  motion_.clear();
  set_window_noise();
  noise_share_ = noise_share_n_ = 0.0;
  published_at_.reset();
  next_direction_ = now;
  calibrating_ = true;
}

void SImuFilter::predict(FilterCore& core, double dt_s) noexcept {
  const SImuLayout& layout = core.layout(index_);
  SImuState& state = core.study(index_);
  // C-17, K-2. Both triads' biases stand side by side in the state, so that one pass over the covariance carries them.
  std::array<double, 6> decay{};
  std::array<double, 6> variance{};
  std::size_t n = 0;
  const auto bias = [&](std::size_t first, const std::array<GaussMarkovConfig, 3>& process, Vector3d& value) {
    if (first == SImuLayout::kAbsent) return;
    for (std::size_t i = 0; i < 3; ++i, ++n) {
      // The axes of a triad mostly share one time constant.
      const bool again = i > 0 && process[i].time_constant_s == process[i - 1].time_constant_s;
      decay[n] = again ? decay[n - 1] : std::exp(-dt_s / process[i].time_constant_s);
      variance[n] = process[i].sd * process[i].sd * (1.0 - decay[n] * decay[n]);
      value(static_cast<Eigen::Index>(i)) *= decay[n];
    }
  };
  bias(layout.gyro_bias, gyro_bias_, state.gyro_bias_s_radps);
  bias(layout.accel_bias, accel_bias_, state.accel_bias_s_mps2);
  const std::size_t first = std::min(layout.gyro_bias, layout.accel_bias);
  if (n > 0) core.predict_states(first, {decay.data(), n}, {variance.data(), n});
  const double creep = config_.boresight_creep_rad_per_sqrt_s;
  if (creep > 0.0 && layout.psi != SImuLayout::kAbsent) {
    for (std::size_t i = 0; i < 3; ++i) core.predict_state(layout.psi + i, 1.0, creep * creep * dt_s);
  }
}

// C-14, C-26: of one sample alone
Vector3d SImuFilter::sample_variance(Triad triad, const SImuState& state, const ReferenceKinematics& b,
                                     const Vector3d& plain) const noexcept {
  const double value = b.value_noise_gain * b.value_noise_gain;
  const Vector3d known = windows_[static_cast<std::size_t>(triad)].known + plain;
  if (triad == Triad::kGyro) return known.array() + value * rate_noise_radps_ * rate_noise_radps_;
  const double slope = rate_noise_radps_ * b.derivative_noise_gain_per_s;
  // [r x][r x]' = |r|^2 I - r r'
  const Vector3d r_s = state.C_b_s * (state.accel_turn * state.r_bs_b_m);
  return known.array() + value * force_noise_mps2_ * force_noise_mps2_ +
         slope * slope * (r_s.squaredNorm() - r_s.array().square());
}

LinearisationSpread SImuFilter::linearisation_spread(const FilterCore& core, Triad triad) const noexcept {
  const SImuLayout& layout = core.layout(index_);
  const CovarianceKernel& P = core.covariance();
  LinearisationSpread spread;
  spread.psi_rad2 = block_of(P, layout.psi, layout.psi);
  spread.r_m2 = block_of(P, layout.r, layout.r);
  if (layout.t_d != SImuLayout::kAbsent) spread.t_d_s2 = P(layout.t_d, layout.t_d);
  if (triad == Triad::kAccel && layout.accel_t_d != SImuLayout::kAbsent) {
    spread.t_d_s2 += P(layout.accel_t_d, layout.accel_t_d);
    if (layout.t_d != SImuLayout::kAbsent) spread.t_d_s2 += 2.0 * P(layout.t_d, layout.accel_t_d);
  }
  return spread;
}

void SImuFilter::correct(SImuContext& context, Triad triad, const ReferenceKinematics& b, double t_d_s,
                         SImuEpoch& epoch) noexcept {
  const bool gyro = triad == Triad::kGyro;
  const std::uint32_t flags = epoch.sample.flags;
  if ((flags & (gyro ? kGyroValid : kAccelValid)) == 0) return;
  FilterCore& core = context.core;
  const SImuState& state = core.study(index_);
  const Vector3d measured = to_eigen(gyro ? epoch.sample.omega_radps : epoch.sample.f_mps2);
  const NoiseVariances& noise =
      variances_[static_cast<std::size_t>(context.regime)][static_cast<std::size_t>(triad)];
  ReferenceMean single(b);
  single.compensate(core.reference_gyro_bias_radps(), core.reference_accel_bias_mps2());
  Windows& windows = windows_[static_cast<std::size_t>(triad)];
  if (!windows.is_known) {
    windows.is_known = true;
    const SImuMeasurement m = gyro ? gyro_measurement(state, core.layout(index_), {}, single, single, {})
                                   : accel_measurement(state, core.layout(index_), {}, single, single, {});
    core.covariance().project(m.H, {});
    windows.known = to_eigen(core.covariance().innovation_covariance()).diagonal();
  }
  const Vector3d y = measured - (gyro ? predicted_rate(state, single) : predicted_force(state, single));
  (gyro ? epoch.innovation_gyro_radps : epoch.innovation_accel_mps2) = to_array(y);
  (gyro ? epoch.variance_gyro : epoch.variance_accel) =
      to_array(sample_variance(triad, state, b, noise.plain));

  const int n = window_.now().n;
  // C-15: into the window that falls and the one that rises
  const double rising = window_weight(n, windows.position);
  const auto first_clip = static_cast<std::uint32_t>(gyro ? kGyroClipX : kAccelClipX);
  for (std::size_t k = 0; k < 2; ++k) {
    Block& block = windows.blocks[k];
    const double weight = k == windows.falling ? 1.0 - rising : rising;
    if (weight == 0.0) continue;
    block.weight += weight;
    block.b.add(weight, b);
    block.measured += weight * measured;
    block.t_d_s += weight * t_d_s;
    for (std::size_t i = 0; i < 3; ++i)
      block.clipped[i] = block.clipped[i] || (flags & (first_clip << i)) != 0;
  }
  for (std::size_t i = 0; i < 3; ++i) {
    if ((flags & (first_clip << i)) != 0)
      ++(gyro ? output_.counters.clipped_gyro : output_.counters.clipped_accel)[i];
  }
  if (++windows.position < n) return;
  windows.position = 0;
  // The first one of all has no rising half.
  if (windows.blocks[windows.falling].weight > kWholeWindow * n) update_from_block(context, triad, epoch);
  windows.blocks[windows.falling] = Block{};
  windows.falling = 1 - windows.falling;
}

void SImuFilter::update_from_block(SImuContext& context, Triad triad, SImuEpoch& epoch) noexcept {
  const bool gyro = triad == Triad::kGyro;
  Windows& windows = windows_[static_cast<std::size_t>(triad)];
  Block& block = windows.blocks[windows.falling];
  const auto [length, gains] = window_.now();
  const double n = length;
  FilterCore& core = context.core;
  const SImuState& state = core.study(index_);
  block.b.scale(1.0 / block.weight);
  block.measured /= block.weight;
  const double t_d_s = state.t_d_s + (gyro ? 0.0 : state.accel_t_d_s);
  block.b.move(t_d_s - block.t_d_s / block.weight);
  block.b.compensate(core.reference_gyro_bias_radps(), core.reference_accel_bias_mps2());
  if (gyro)
    motion_.add(block.b, core.reference_gyro_bias_radps(), core.reference_accel_bias_mps2(),
                n / config_.rate_hz);
  // The filter may have begun in the middle of a turn, of which the lever arm's share is not known then.
  if (!motion_.can_tell()) return;
  // C-13: what of the window's means is motion
  const ReferenceMean believed = motion_.believed(block.b);
  const ReferenceMean expected = motion_.expected(block.b);
  const ReferenceBiasColumns columns =
      has_biases_ ? ReferenceBiasColumns{kGyroBiasError, kAccelBiasError} : ReferenceBiasColumns{};
  const double per_sqrt_n = 1.0 / std::sqrt(n);
  // C-26: the reference's noise in the window's means
  const ReferenceNoise own{rate_noise_radps_ * per_sqrt_n,
                           rate_noise_radps_ * gains.slope_per_s *
                               std::sqrt(kSlopeCorrelation * motion_.rate_slope_share().maxCoeff()),
                           force_noise_mps2_ * per_sqrt_n};
  const SImuMeasurement m =
      gyro ? gyro_measurement(state, core.layout(index_), columns, expected, believed, own)
           : accel_measurement(state, core.layout(index_), columns, expected, believed, own);
  const NoiseVariances& noise =
      variances_[static_cast<std::size_t>(context.regime)][static_cast<std::size_t>(triad)];
  const Vector3d y = block.measured - m.predicted;
  // Neighbouring windows share samples: R is what all updates together know of a constant, NIS that of one.
  const LinearisationSpread spread = linearisation_spread(core, triad);
  Matrix3d R = m.reference_covariance + (gyro ? second_order_rate(state, believed, spread)
                                              : second_order_force(state, believed, spread));
  // C-14, C-15
  R.diagonal() += noise.inflated / n;
  // C-24: where innovations have long been larger than the noise allows, the noise is what they say.
  const Vector3d factor = monitor_.noise_factor(triad, context.regime);
  const Vector3d configured = R.diagonal();
  R = factor.cwiseSqrt().asDiagonal() * R * factor.cwiseSqrt().asDiagonal();
  // C-15: of one window alone
  const Vector3d excess = (noise.inflated - window_white_share(length) * noise.plain) / n;
  core.covariance().project(m.H, to_array(R));
  const Matrix3d S = to_eigen(core.covariance().innovation_covariance());
  windows.known = S.diagonal() - R.diagonal();
  const Vector3d plain = windows.known + configured - excess;
  if (length == 1) (gyro ? epoch.variance_gyro : epoch.variance_accel) = to_array(plain);
  if (!gyro && motion_.moving()) {
    noise_share_n_ += 1.0;
    noise_share_ += (motion_.noise_in_rate_slope() - noise_share_) / noise_share_n_;
  }

  SImuCounters& counters = output_.counters;
  std::array<bool, 3>& use = gyro ? epoch.used_gyro : epoch.used_accel;
  Vector3& nis = gyro ? output_.nis_gyro : output_.nis_accel;
  const double share = std::min(1.0, n / (kNisMean_s * config_.rate_hz));
  for (std::size_t i = 0; i < 3; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    use[i] = !block.clipped[i];
    if (!use[i]) continue;
    // E-3
    use[i] = !has_biases_ || y(k) * y(k) <= gate_ * S(k, k);
    if (!use[i]) ++(gyro ? counters.gated_gyro : counters.gated_accel)[i];
    nis[i] += share * (y(k) * y(k) / plain(k) - nis[i]);
  }
  monitor_.watch_update({.triad = triad,
                         .regime = context.regime,
                         .time = epoch.time,
                         .samples = length,
                         .gate = gate_,
                         .y = y,
                         .S = S.diagonal(),
                         .plain = plain,
                         .known = windows.known,
                         .clipped = block.clipped,
                         .used = use},
                        config_, context.log);
  core.update(y, use);
  if (!gyro && window_.choose(motion_)) {
    restart_windows();
    set_window_noise();
  }
}

void SImuFilter::start_again(FilterCore& core) noexcept {
  ++output_.counters.resets;
  reset_to_prior(core, index_, config_);
  calibrating_ = false;
  output_.status = CalibrationStatus::kWaiting;
}

void SImuFilter::look_anew(FilterCore& core, HostTime now) noexcept {
  start_again(core);
  prior_in_force_ = false;
  coarse_t_d_s_ = 0.0;
  coarse_mounting_.clear();
  output_.status = CalibrationStatus::kCoarse;
  next_attempt_ = now + kCoarseEvery;
}

void SImuFilter::set_noise(FilterCore& core, const SImuNoise& noise) noexcept {
  const SImuLayout& layout = core.layout(index_);
  // The part of the bias variance that the process accounts for moves with it; correlations stay.
  const auto rescale = [&](std::size_t first, const std::array<GaussMarkovConfig, 3>& before,
                           const std::array<GaussMarkovConfig, 3>& after) {
    if (first == SImuLayout::kAbsent) return;
    for (std::size_t i = 0; i < 3; ++i) {
      const double grown = after[i].sd * after[i].sd - before[i].sd * before[i].sd;
      if (grown > 0.0)
        core.predict_state(first + i, 1.0, std::min(grown, core.covariance()(first + i, first + i)));
    }
  };
  rescale(layout.gyro_bias, config_.noise.gyro_bias, noise.gyro_bias);
  rescale(layout.accel_bias, config_.noise.accel_bias, noise.accel_bias);
  config_.noise = noise;
  const double share = config_.noise_floor_share;
  for (std::size_t regime = 0; regime < kRegimeCount; ++regime) {
    for (std::size_t i = 0; i < 3; ++i) {
      double& gyro = config_.noise.gyro[regime].white_sd[i];
      double& accel = config_.noise.accel[regime].white_sd[i];
      gyro = std::max(gyro, share * gyro_floor_[regime].white_sd[i]);
      accel = std::max(accel, share * accel_floor_[regime].white_sd[i]);
    }
  }
  precompute_noise();
}

void SImuFilter::update_output(const FilterCore& core, EventLog& log) noexcept {
  output_.contradicts = monitor_.misfits();
  if (!calibrating_) return;
  const SImuState& state = core.study(index_);
  const SImuLayout& layout = core.layout(index_);
  if (mounting_may_have_moved(core)) publish_mounting(core);
  output_.t_d_s = state.t_d_s;
  output_.gyro_bias_radps = to_array(state.gyro_bias_s_radps);
  output_.accel_bias_mps2 = to_array(state.accel_bias_s_mps2);
  output_.gyro_scale = to_array(state.gyro_scale);
  output_.accel_scale = to_array(state.accel_scale);
  const auto sd_of = [&](std::size_t first, Vector3& out) {
    for (std::size_t i = 0; i < 3; ++i) out[i] = first == SImuLayout::kAbsent ? 0.0 : core.sd(first + i);
  };
  sd_of(layout.gyro_bias, output_.sd_gyro_bias_radps);
  sd_of(layout.accel_bias, output_.sd_accel_bias_mps2);
  sd_of(layout.gyro_scale, output_.sd_gyro_scale);
  sd_of(layout.accel_scale, output_.sd_accel_scale);
  output_.accel_t_d_s = state.accel_t_d_s;
  output_.sd_accel_t_d_s = core.sd(layout.accel_t_d);
  output_.sd_t_d_s = core.sd(layout.t_d);

  if (layout.accel_boresight != SImuLayout::kAbsent) {
    for (std::size_t i = 0; i < 3; ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      // C-21
      output_.sd_gyro_scale[i] =
          std::hypot(output_.sd_gyro_scale[i], gyro_scale_by_reference_(k), kLowPassShare);
      output_.sd_accel_scale[i] =
          std::hypot(output_.sd_accel_scale[i], accel_scale_by_reference_(k), kLowPassShare);
    }
  }
  const MountingMonitor::Verdict verdict = monitor_.judge(output_, layout);
  output_.observable = verdict.observable;
  output_.t_d_observable = verdict.t_d_observable;
  output_.status = verdict.is_calibrated ? CalibrationStatus::kCalibrated : CalibrationStatus::kConverging;
  if (output_.time >= next_direction_) {
    next_direction_ = output_.time + kDirectionEvery;
    const MountingMonitor::Weakest weakest = monitor_.weakest_direction(output_, layout);
    output_.weakest_direction = weakest.direction;
    output_.weakest_component = weakest.component;
    output_.weakest_relative_sd = weakest.relative_sd;
    if (has_biases_) monitor_.watch_priors(output_, config_, log);
  }
}

// A mounting does not age: most ticks bring no update, and it stays what it was.
bool SImuFilter::mounting_may_have_moved(const FilterCore& core) noexcept {
  const bool creeps = config_.boresight_creep_rad_per_sqrt_s > 0.0;
  const PublishedAt now{core.changes(), noise_share_};
  return std::exchange(published_at_, now) != now || creeps;
}

void SImuFilter::publish_mounting(const FilterCore& core) noexcept {
  const SImuState& state = core.study(index_);
  const SImuLayout& layout = core.layout(index_);
  const CovarianceKernel& P = core.covariance();
  const auto block = [&P](std::size_t row, std::size_t column) { return block_of(P, row, column); };
  // C-22: from the frame that leans to no axis to the one along the x gyro.
  const Matrix3d by_axes = state.C_b_s.transpose() * kLeanOfAxes.asDiagonal();
  const Vector3d gyro_turn = kLeanOfAxes.cwiseProduct(state.gyro_axes);
  const Matrix3d C_published = exp_so3(-gyro_turn) * state.C_b_s;
  output_.C_b_s = to_array(C_published);
  output_.psi_rad = to_array(Vector3d(-log_so3(to_eigen(output_.C_prior).transpose() * C_published)));
  output_.r_bs_b_m = to_array(state.r_bs_b_m);
  const Matrix3d turned = by_axes * block(layout.gyro_axes, layout.psi);
  Matrix3d psi = block(layout.psi, layout.psi) + turned + turned.transpose() +
                 by_axes * block(layout.gyro_axes, layout.gyro_axes) * by_axes.transpose();
  Matrix3d psi_r = block(layout.psi, layout.r) + by_axes * block(layout.gyro_axes, layout.r);
  Matrix3d r = block(layout.r, layout.r);
  // C-22: the noise is known to a share, so the lever arm that it takes (1 - s of C-13) is, too.
  const Vector3d attenuated = noise_known_to_ * noise_share_ * state.r_bs_b_m;
  if (layout.r != SImuLayout::kAbsent) r += attenuated * attenuated.transpose();
  Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>> covariance(output_.covariance_psi_r.data());
  // C-25
  const double beyond_class = monitor_.watch_class(core, index_, config_);
  psi *= beyond_class * beyond_class;
  r *= beyond_class * beyond_class;
  psi_r *= beyond_class * beyond_class;
  // C-27
  const ReferenceColumns F = reference_columns(affected_by_axes(P, layout), prior_of_axes(config_, layout),
                                               state.C_b_s, reference_grade_);
  const auto rows = [&F](Eigen::Index state_rows) { return F.middleRows<3>(state_rows); };
  const ThreeRows F_psi = rows(affected::kPsi) + by_axes * rows(affected::kGyroAxes);
  psi += F_psi * F_psi.transpose();
  psi_r += F_psi * rows(affected::kR).transpose();
  r += rows(affected::kR) * rows(affected::kR).transpose();
  if (layout.accel_boresight != SImuLayout::kAbsent && layout.r != SImuLayout::kAbsent)
    r.diagonal() += r_by_scale_m2(state.r_bs_b_m, reference_grade_);
  gyro_scale_by_reference_ = rows(affected::kGyroScale).rowwise().norm();
  accel_scale_by_reference_ = rows(affected::kAccelScale).rowwise().norm();
  covariance << psi, psi_r, psi_r.transpose(), r;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    output_.sd_psi_rad[i] = std::sqrt(psi(k, k));
    output_.sd_r_bs_b_m[i] = std::sqrt(r(k, k));
  }
  monitor_.watch_attenuation(attenuated, output_.sd_r_bs_b_m);
  publish_accel_triad(core, F);
}

void SImuFilter::publish_accel_triad(const FilterCore& core, const ReferenceColumns& F) noexcept {
  const SImuState& state = core.study(index_);
  const SImuLayout& layout = core.layout(index_);
  const auto block = [&core](std::size_t row, std::size_t column) {
    return block_of(core.covariance(), row, column);
  };
  // C-22: alpha, of both triads
  const Matrix3d by_axes = state.C_b_s.transpose() * kLeanOfAxes.asDiagonal();
  const Vector3d accel_turn = kLeanOfAxes.cwiseProduct(state.accel_axes);
  const Matrix3d C_accel = exp_so3(-accel_turn) * state.C_b_s * state.accel_turn;
  output_.accel_boresight_rad = to_array(Vector3d(-log_so3(to_eigen(output_.C_b_s).transpose() * C_accel)));
  const Matrix3d alpha_g = block(layout.accel_boresight, layout.gyro_axes);
  const Matrix3d alpha_a = block(layout.accel_boresight, layout.accel_axes);
  const Matrix3d g_g = block(layout.gyro_axes, layout.gyro_axes);
  const Matrix3d a_a = block(layout.accel_axes, layout.accel_axes);
  const Matrix3d g_a = block(layout.gyro_axes, layout.accel_axes);
  const Matrix3d mixed = (alpha_a - alpha_g) * by_axes.transpose();
  const Matrix3d alpha = block(layout.accel_boresight, layout.accel_boresight) + mixed + mixed.transpose() +
                         by_axes * (a_a + g_g - g_a - g_a.transpose()) * by_axes.transpose();
  const ThreeRows F_alpha =
      F.middleRows<3>(affected::kAccelBoresight) +
      by_axes * (F.middleRows<3>(affected::kAccelAxes) - F.middleRows<3>(affected::kGyroAxes));
  for (std::size_t i = 0; i < 3; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    output_.sd_accel_boresight_rad[i] = layout.accel_boresight == SImuLayout::kAbsent
                                            ? 0.0
                                            : std::sqrt(alpha(k, k) + F_alpha.row(k).squaredNorm());
  }
}

}  // namespace imuscope
