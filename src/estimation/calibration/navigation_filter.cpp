#include "estimation/calibration/navigation_filter.h"

#include "base/limits.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "estimation/calibration/gnss_trust.h"
#include "estimation/calibration/navigation_output.h"
#include "estimation/navigation/local_earth.h"
#include "estimation/navigation/so3.h"
#include "estimation/navigation/strapdown.h"

namespace imuscope {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// E-6. Longest interval that is bridged by interpolating the rates; beyond it the navigation starts anew.
constexpr double kBridgedGap_s = 1.0;
/// An interval of UTC is never further from the host's than this share of it.
constexpr double kIntervalShare = 0.5;
/// Steps in which a gap is bridged; the transition is a second-order expansion.
constexpr double kStep_s = 0.05;
/// What a road vehicle's rate and force may do unseen during a gap, as white noise, rad/s and m/s^2 per
/// sqrt(Hz).
constexpr double kUnseenRate = 0.05;
constexpr double kUnseenForce = 0.5;
/// A GNSS solution may be newer than the newest R epoch by this much and still be taken there.
constexpr Duration kGnssAhead = std::chrono::milliseconds{1};
/// Where the tags of two devices may be a leap second apart.
constexpr Duration kAroundMidnight = std::chrono::minutes{1};
/// Between a solution by its own clock map and by its UTC tag: what moves without a leap second.
constexpr Duration kLagWanders = std::chrono::milliseconds{100};
/// N-37. By UTC tags: what two devices' ideas of an instant lie apart. By pulses: the delay of the R-IMU's
/// stream. By stamps two clock maps' lines move: 1 ms or so in the first minute, little later.
constexpr double kTaggedLatencySd_s = 1e-3;
constexpr double kStreamDelaySd_s = 5e-3;
constexpr double kLatencyWalk_s_per_sqrt_s = 1e-4;
/// N-36: what a road vehicle accelerates by.
constexpr double kStartAcceleration_mps2 = 2.0;
/// Attitude of which rest tells all: wide against what it tells, narrow enough to be linear.
constexpr double kRestAttitudeSd_rad = 0.1;
constexpr double kConfiguredStartVelocitySd_mps = 0.05;
/// One position in twenty has a NIS (3 degrees of freedom) above this where sd and lever arm are right. When
/// a quarter of a minute's have, something is wrong with them.
constexpr double kImprobableNis = 7.815;
constexpr double kImprobableShareMax = 0.25;
constexpr double kConsistencyMean_s = 60.0;
constexpr double kConsistencyStep_s = 1.0;
/// Re-acquisition: velocity is uncertain by this much.
constexpr double kReacquireVelocitySd_mps = 3.0;

NavigationProcessNoise process_noise(const ReferenceConfig& config) noexcept {
  return {config.gyro_white_radps_per_sqrt_hz,
          config.accel_white_mps2_per_sqrt_hz,
          {config.gyro_bias.sd, config.gyro_bias.time_constant_s},
          {config.accel_bias.sd, config.accel_bias.time_constant_s}};
}

InitialAlignmentOptions alignment_options(const EstimatorConfig& config) noexcept {
  InitialAlignmentOptions options;
  options.reference_noise = process_noise(config.reference);
  // What levels are told by.
  options.reference_noise.accel_bias.sd = start_accel_bias_sd_mps2(config.reference)[0];
  options.r_ba_b_m = to_eigen(config.gnss.antenna_lever_arm_b_m);
  return options;
}

/// The reference's own count may be further on than the host's clock by so much: else the host's clock stood
/// still.
constexpr double kSleptMin_s = 0.5;
/// A receiver's message comes within this after its epoch.
constexpr Duration kPulsesAgree = std::chrono::milliseconds{500};

InertialRates rates_of(const ImuData& imu) noexcept {
  return {to_eigen(imu.omega_radps), to_eigen(imu.f_mps2)};
}

InertialRates mixed(const InertialRates& a, const InertialRates& b, double share_of_b) noexcept {
  return {a.omega_ib_b_radps + share_of_b * (b.omega_ib_b_radps - a.omega_ib_b_radps),
          a.f_b_mps2 + share_of_b * (b.f_b_mps2 - a.f_b_mps2)};
}

/// N-27. A first-order low-pass of this time constant leaves a twelfth of an engine at 8 Hz, and a manoeuvre.
constexpr double kVibrationGone_s = 0.25;
/// Faster than this a vehicle turns, too; slower, what a noisy gyro shows is noise.
constexpr double kMoves_mps = 1.0;

bool moves(const NavigationState& state) noexcept {
  return state.v_n_mps.squaredNorm() > kMoves_mps * kMoves_mps;
}

/// Below this a filter's velocity may be GNSS noise alone: the vehicle stands, and is not turning about its antenna,
/// which GNSS would not see.
constexpr double kStands_mps = 0.1;

bool stands(const NavigationState& state) noexcept {
  return state.v_n_mps.squaredNorm() < kStands_mps * kStands_mps;
}

bool is_finite(const GnssData& gnss) noexcept {
  return std::isfinite(gnss.latitude_rad) && std::isfinite(gnss.longitude_rad) &&
         std::isfinite(gnss.height_m) &&
         std::ranges::all_of(gnss.v_n_mps, [](double value) { return std::isfinite(value); });
}

InitialisationMethod method_of(AlignmentMethod method) noexcept {
  switch (method) {
    case AlignmentMethod::kReferenceAttitude:
      return InitialisationMethod::kReferenceAttitude;
    case AlignmentMethod::kGyrocompass:
      return InitialisationMethod::kGyrocompass;
    case AlignmentMethod::kInMotion:
      break;
  }
  return InitialisationMethod::kInMotion;
}

}  // namespace

NavigationFilter::NavigationFilter(const EstimatorConfig& config, FilterCore& core, EventLog& log,
                                   EstimatorCounters& counters)
    : reference_(config.reference),
      gnss_(config.gnss),
      navigation_(config.navigation),
      noise_(process_noise(config.reference)),
      core_(core),
      log_(log),
      counters_(counters),
      arm_rate_(noise_.gyro_noise_radps_per_sqrt_hz * std::sqrt(reference_.rate_hz), reference_.rate_hz),
      aligner_(alignment_options(config)),
      past_(reference_past_capacity(config.reference.rate_hz)) {
  const bool offered = navigation_.enabled && gnss_.enabled;
  output_.status = offered ? NavigationStatus::kInitialising : NavigationStatus::kNotOffered;
}

NavigationFilter::PastEpoch& NavigationFilter::past(std::size_t back) noexcept {
  return past_[(past_head_ + past_.size() - 1 - back) % past_.size()];
}
const NavigationFilter::PastEpoch& NavigationFilter::past(std::size_t back) const noexcept {
  return past_[(past_head_ + past_.size() - 1 - back) % past_.size()];
}

/// N-56: the interval in seconds of UTC, wherever a device tells them; else in the host's own.
double NavigationFilter::interval_to(const Sample& sample) noexcept {
  const double host_s = to_seconds(sample.time - last_time_);
  // A PC that slept: its clock stood still, and the device has counted on.
  const double counted_s = static_cast<double>(sample.imu.counter - last_counter_) / reference_.rate_hz;
  const bool slept = has_last_ && (sample.imu.flags & kGapBefore) != 0 && counted_s > host_s + kSleptMin_s;
  last_counter_ = sample.imu.counter;
  const bool was_known = utc_scale_.is_known();
  if (sample.has_utc) utc_scale_.observe(UtcSource::kReference, sample.time, sample.utc);
  const double before_s = last_seconds_;
  last_seconds_ = utc_scale_.seconds_at(sample.time);
  if (slept) return counted_s;
  if (!was_known) return host_s;
  return std::clamp(last_seconds_ - before_s, (1.0 - kIntervalShare) * host_s,
                    (1.0 + kIntervalShare) * host_s);
}

void NavigationFilter::add_reference(const Sample& sample) noexcept {
  const InertialRates measured = rates_of(sample.imu);
  const double dt_s = interval_to(sample);
  if (has_last_) {
    if (navigating() && dt_s > kBridgedGap_s) stop(sample.time, dt_s);
    if (navigating()) {
      carry_over_interval(measured, (sample.imu.flags & kIsIncrement) != 0, dt_s);
    } else {
      predict_biases_only(dt_s);
    }
  }
  has_last_ = true;
  last_time_ = sample.time;
  last_utc_ = sample.utc;
  last_has_utc_ = sample.has_utc;
  last_ = measured;
  if (output_.status == NavigationStatus::kNotOffered) return;
  if (navigating()) {
    remember(sample, measured);
  } else {
    try_start(sample);
  }
  if (pending_size_ == 0) return;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < pending_size_; ++i) {
    if (!apply_gnss(pending_[i])) pending_[kept++] = pending_[i];
  }
  pending_size_ = kept;
}

void NavigationFilter::carry_over_interval(const InertialRates& measured, bool is_mean,
                                           double dt_s) noexcept {
  NavigationState& state = core_.navigation();
  const bool gap = dt_s > 1.5 / reference_.rate_hz;
  if (!gap) {
    past(0).injected = core_.take_injected();
    const InertialRates start = compensated(last_, state);
    const InertialRates end = compensated(measured, state);
    predict(is_mean ? end : mixed(start, end, 0.5), dt_s, 0.0);
    propagate(state,
              is_mean ? increment_from_means(start, end, dt_s) : increment_from_samples(start, end, dt_s));
    return;
  }
  // E-6: rates between those of both ends
  const int steps = static_cast<int>(std::ceil(dt_s / kStep_s));
  const double step_s = dt_s / steps;
  for (int i = 0; i < steps; ++i) {
    const InertialRates start = compensated(mixed(last_, measured, static_cast<double>(i) / steps), state);
    const InertialRates end = compensated(mixed(last_, measured, static_cast<double>(i + 1) / steps), state);
    predict(mixed(start, end, 0.5), step_s, 1.0);
    propagate(state, increment_from_samples(start, end, step_s));
  }
  // Past states are no longer one R epoch apart; a solution from before the gap is given up.
  past_size_ = 0;
  core_.take_injected();
}

void NavigationFilter::predict(const InertialRates& rates, double dt_s, double unseen) noexcept {
  NavigationProcessNoise noise = noise_;
  manoeuvre_ = mixed(manoeuvre_, rates, -std::expm1(-dt_s / kVibrationGone_s));
  noise.set_motion(reference_.grade, core_.navigation(), manoeuvre_);
  // E-6: what nobody saw
  noise.gyro_noise_radps_per_sqrt_hz += unseen * kUnseenRate;
  noise.accel_noise_mps2_per_sqrt_hz += unseen * kUnseenForce;
  const NavigationTransition step = transition(core_.navigation(), rates, noise, dt_s);
  core_.predict_navigation(step);
  core_.navigation().gyro_bias_b_radps *= step.gyro_bias_decay;
  core_.navigation().accel_bias_b_mps2 *= step.accel_bias_decay;
  PastEpoch& next = past_[past_head_];
  next.kinematic_rows = step.kinematic_rows;
  next.gyro_bias_decay = step.gyro_bias_decay;
  next.accel_bias_decay = step.accel_bias_decay;
}

void NavigationFilter::predict_biases_only(double dt_s) noexcept {
  const auto decay_block = [&](std::size_t first, const GaussMarkovConfig& process, Vector3d& bias) {
    // N-25, N-26: the biases' own
    const double decay = std::exp(-dt_s / process.time_constant_s);
    const double variance = process.sd * process.sd * (1.0 - decay * decay);
    for (std::size_t i = 0; i < 3; ++i) core_.predict_state(first + i, decay, variance);
    bias *= decay;
  };
  decay_block(kGyroBiasError, reference_.gyro_bias, core_.navigation().gyro_bias_b_radps);
  decay_block(kAccelBiasError, reference_.accel_bias, core_.navigation().accel_bias_b_mps2);
}

void NavigationFilter::remember(const Sample& sample, const InertialRates& measured) noexcept {
  PastEpoch& next = past_[past_head_];
  next.time = sample.time;
  next.utc = sample.utc;
  next.has_utc = sample.has_utc;
  next.state = core_.navigation();
  next.measured = measured;
  past_head_ = (past_head_ + 1) % past_.size();
  past_size_ = std::min(past_size_ + 1, past_.size());
  const std::size_t half_width = arm_rate_.half_width();
  if (half_width > 0 && past_size_ > 2 * half_width && moves(core_.navigation()))
    arm_rate_.learn(mean_rate(half_width, half_width) - core_.reference_gyro_bias_radps());
}

Vector3d NavigationFilter::mean_rate(std::size_t centre, std::size_t half_width) const noexcept {
  Vector3d sum = Vector3d::Zero();
  for (std::size_t k = centre - half_width; k <= centre + half_width; ++k)
    sum += past(k).measured.omega_ib_b_radps;
  return sum / static_cast<double>(2 * half_width + 1);
}

/// E-5a, at an instant that lies by a share of the interval behind epoch k.
InertialRates NavigationFilter::measured_between(std::size_t k, double share_of_newer) const noexcept {
  const InertialRates& before = past(k).measured;
  const InertialRates& after = past(k - 1).measured;
  if (k < 2 || k + 1 >= past_size_) return mixed(before, after, share_of_newer);
  const double s = share_of_newer;
  const std::array<double, 4> weights{-s * (1.0 - s) * (2.0 - s) / 6.0,
                                      (1.0 + s) * (1.0 - s) * (2.0 - s) / 2.0,
                                      (1.0 + s) * s * (2.0 - s) / 2.0, -(1.0 + s) * s * (1.0 - s) / 6.0};
  InertialRates sum;
  for (std::size_t i = 0; i < 4; ++i) {
    const InertialRates& one = past(k + 1 - i).measured;
    sum.omega_ib_b_radps += weights[i] * one.omega_ib_b_radps;
    sum.f_b_mps2 += weights[i] * one.f_b_mps2;
  }
  return sum;
}

/// E-29, at an instant that lies by a share of the interval behind epoch k.
void NavigationFilter::set_arm_rate(std::size_t k, double share_of_newer, Delayed& out) const noexcept {
  const Vector3d& bias = out.state.gyro_bias_b_radps;
  out.swing_omega_ib_b_radps = out.measured.omega_ib_b_radps;
  out.swing_share.setOnes();
  out.sd_swing_radps = 0.0;
  out.rate_share = 1.0;
  out.sd_rate_radps = 0.0;
  if (arm_rate_.half_width() == 0) return;
  const std::size_t newer = share_of_newer > 0.0 && k > 0 ? k - 1 : k;
  // The newest are not there yet.
  const std::size_t half_width = std::min({arm_rate_.half_width(), newer, past_size_ - 1 - k});
  const Vector3d mean =
      (1.0 - share_of_newer) * mean_rate(k, half_width) + share_of_newer * mean_rate(newer, half_width);
  const std::size_t samples = 2 * half_width + 1;
  const bool may_turn = !stands(out.state);
  const ArmRate::Estimate swing = arm_rate_.estimate(mean - bias, samples, moves(out.state));
  out.swing_omega_ib_b_radps = bias + swing.omega_b_radps;
  out.swing_share = swing.share;
  out.sd_swing_radps = swing.sd_radps;
  out.rate_share = may_turn ? 1.0 : 0.0;
  out.measured.omega_ib_b_radps = may_turn ? mean : bias;
  if (may_turn) out.sd_rate_radps = arm_rate_.sd_of_mean_radps(samples);
}

void NavigationFilter::try_start(const Sample& sample) noexcept {
  if (navigation_.initial_rpy_rad) return;  // waits for the first position, in add_gnss()
  aligner_.add_imu(sample.time, last_, 1.0 + utc_scale_.scale().rate);
  if (const InitialNavigation* found = aligner_.result()) {
    start(found->state, found->sd, method_of(found->method), sample.time);
    if (found->rest.length_s > 0.0) take_rest(found->rest, output_.method);
    remember(sample, last_);
    return;
  }
  output_.status = aligner_.stage() == AlignmentStage::kWaitingForHeading ? NavigationStatus::kAligning
                                                                          : NavigationStatus::kInitialising;
}

void NavigationFilter::start(const NavigationState& state, const NavigationErrorVector& sd,
                             InitialisationMethod method, HostTime time) noexcept {
  NavigationState& now = core_.navigation();
  const Vector3d gyro_bias = now.gyro_bias_b_radps;
  const Vector3d accel_bias = now.accel_bias_b_mps2;
  now = state;
  // The R biases live on in the filter, with what the S-IMUs know of them.
  now.gyro_bias_b_radps = gyro_bias;
  now.accel_bias_b_mps2 = accel_bias;
  manoeuvre_ = compensated(last_, now);
  for (std::size_t i = 0; i < kNavigationKinematicSize; ++i) {
    const double value = sd(static_cast<Eigen::Index>(i));
    core_.reset_state(i, value * value);
  }
  correlate_with_antenna();
  core_.take_injected();
  past_size_ = 0;
  output_.status = NavigationStatus::kNavigating;
  output_.has_gnss = false;
  output_.method = method;
  log_.add(event::NavigationStarted{method}, reference_.device, time);
}

/// N-36
void NavigationFilter::correlate_with_antenna() noexcept {
  CovarianceKernel& P = core_.covariance();
  const NavigationState& state = core_.navigation();
  const std::size_t arm = core_.antenna_states() + kAntennaLeverArmError;
  const std::size_t latency = core_.antenna_states() + kReceiverLatencyError;
  const double latency_variance = P(latency, latency);
  Matrix3d P_ll;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j)
      P_ll(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = P(arm + i, arm + j);
  }
  const Matrix3d P_rl = -state.C_b_n * P_ll;
  const Vector3d P_rt = state.v_n_mps * latency_variance;
  const Matrix3d more = -P_rl * state.C_b_n.transpose() + P_rt * state.v_n_mps.transpose();
  for (std::size_t i = 0; i < 3; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    for (std::size_t j = 0; j < 3; ++j) {
      P.set(kPositionError + i, arm + j, P_rl(k, static_cast<Eigen::Index>(j)));
      if (j <= i)
        P.set(kPositionError + i, kPositionError + j,
              P(kPositionError + i, kPositionError + j) + more(k, static_cast<Eigen::Index>(j)));
    }
    P.set(kPositionError + i, latency, P_rt(k));
    P.set(kVelocityError + i, kVelocityError + i,
          P(kVelocityError + i, kVelocityError + i) +
              kStartAcceleration_mps2 * kStartAcceleration_mps2 * latency_variance);
  }
}

/// N-47, N-49: what rest showed, as measurements of attitude and biases together. Where the heading came from
/// it as well, attitude is known from nothing else.
void NavigationFilter::take_rest(const AlignmentRest& rest, InitialisationMethod method) noexcept {
  const NavigationState& state = core_.navigation();
  const Matrix3d C_b_n = rest.C_b_n;
  const double age_s = rest.age_s + 0.5 * rest.length_s;
  const auto variance = [&](double white, double other_sd, const GaussMarkovConfig& bias) {
    const double wandered = -std::expm1(-2.0 * age_s / bias.time_constant_s);
    return white * white / rest.length_s + other_sd * other_sd + wandered * bias.sd * bias.sd;
  };
  const auto take = [&](const Vector3d& shown_b, const Vector3d& true_n, std::size_t bias, double R,
                        const std::array<bool, 3>& rows) {
    NavigationMeasurementMatrix H = NavigationMeasurementMatrix::Zero();
    H.middleCols<3>(kAttitudeError) = skew(true_n);
    H.middleCols<3>(static_cast<Eigen::Index>(bias)) = C_b_n;
    SparseMeasurement sparse;
    append_columns(H, 0, sparse);
    core_.covariance().project(sparse, to_array(Matrix3d(R * Matrix3d::Identity())));
    core_.update(C_b_n * shown_b - true_n, rows);
  };
  if (method == InitialisationMethod::kGyrocompass) {
    for (std::size_t i = 0; i < 3; ++i)
      core_.reset_state(kAttitudeError + i, kRestAttitudeSd_rad * kRestAttitudeSd_rad);
    // N-49
    const Vector3d force_n = -LocalEarth(state.position).gravity_n();
    // Down tells of gravity and scale as much as of a bias.
    take(rest.mean.f_b_mps2 - state.accel_bias_b_mps2, force_n, kAccelBiasError,
         variance(noise_.accel_noise_mps2_per_sqrt_hz, 0.0, reference_.accel_bias), {true, true, false});
  }
  // N-47
  take(rest.mean.omega_ib_b_radps - state.gyro_bias_b_radps, earth_rate_n(state.position.latitude_rad),
       kGyroBiasError, variance(noise_.gyro_noise_radps_per_sqrt_hz, rest.sway_radps, reference_.gyro_bias),
       {true, true, true});
  core_.take_injected();
}

void NavigationFilter::stop(HostTime time, double gap_s) noexcept {
  output_.status = NavigationStatus::kInitialising;
  output_.method = InitialisationMethod::kNone;
  // A configured attitude belonged to the first start.
  navigation_.initial_rpy_rad.reset();
  past_size_ = 0;
  for (std::size_t i = 0; i < kNavigationKinematicSize; ++i) core_.reset_state(i, 0.0);
  core_.take_injected();
  log_.add(event::NavigationStopped{gap_s}, reference_.device, time);
}

void NavigationFilter::add_attitude(const Sample& sample) noexcept {
  constexpr std::uint32_t kWhole = kRollPitchValid | kHeadingValid;
  if (output_.status == NavigationStatus::kNotOffered || navigating()) return;
  const AttitudeData& a = sample.attitude;
  if ((a.flags & kWhole) != kWhole || !std::isfinite(a.roll_rad + a.pitch_rad + a.heading_rad)) return;
  const Vector3d configured = to_eigen(navigation_.initial_rpy_sd_rad);
  const Vector3d sd =
      (a.flags & kHasAttitudeSd) != 0 ? floored_sd(to_eigen(a.sd_rpy_rad), configured) : configured;
  aligner_.add_attitude(sample.time, {a.roll_rad, a.pitch_rad, a.heading_rad}, sd);
}

void NavigationFilter::add_gnss(const Sample& sample) noexcept {
  ++counters_.gnss_samples;
  if (sample.has_utc)
    utc_scale_.observe(UtcSource::kGnss, sample.time - from_seconds(gnss_.latency_s), sample.utc);
  if (!is_finite(sample.gnss)) {
    ++counters_.gnss_not_finite;
    return;
  }
  if (output_.status == NavigationStatus::kNotOffered || sample.gnss.solution == GnssSolution::kNone) return;
  if (apply_gnss(sample)) return;
  if (pending_size_ == kPendingGnss) {
    std::copy(pending_.begin() + 1, pending_.end(), pending_.begin());
    --pending_size_;
    ++counters_.gnss_too_old;
  }
  pending_[pending_size_++] = sample;
}

void NavigationFilter::add_pulse(const Sample& sample) noexcept {
  utc_scale_.observe_pulse(sample.time, utc_time_from_ns(sample.pulse.wall_ns));
}

void NavigationFilter::add_steering(const Sample& sample) noexcept {
  utc_scale_.observe_steering(sample.time, host_time_from_ns(sample.steering.unsteered_ns),
                              sample.steering.rate);
}

/// The solution's instant as far as it is told; its latency is not taken off.
NavigationFilter::Met NavigationFilter::met(const Sample& gnss) const noexcept {
  const Met by_stamp{gnss.time, Meeting::kStamps};
  if (gnss.has_utc && !last_has_utc_ && time_scale().source == UtcSource::kPulses) {
    // Pulses tell the host's time of any UTC. A leap second that they have not counted yet shows as one.
    const HostTime by_pulses = utc_scale_.host_time_by_pulses(gnss.utc);
    const bool agree = std::chrono::abs(gnss.time - from_seconds(gnss_.latency_s) - by_pulses) < kPulsesAgree;
    return agree ? Met{by_pulses, Meeting::kPulses} : by_stamp;
  }
  if (!gnss.has_utc || !last_has_utc_) return by_stamp;
  // The tag of the nearest R epoch carries the solution to host time, so that clock maps cannot part them.
  const PastEpoch* nearest = nullptr;
  for (std::size_t back = 0; back < past_size_; ++back) {
    if (!past(back).has_utc) continue;
    nearest = &past(back);
    if (past(back).utc <= gnss.utc) break;
  }
  if (nearest == nullptr) return {last_time_ + (gnss.utc - last_utc_), Meeting::kTags};
  return {nearest->time + (gnss.utc - nearest->utc), Meeting::kTags};
}

/// N-37: the latency's state up to a solution's time.
void NavigationFilter::carry_latency(Meeting by, HostTime time) noexcept {
  const std::size_t latency = core_.antenna_states() + kReceiverLatencyError;
  if (by != meeting_) {
    meeting_ = by;
    core_.reset_latency(by == Meeting::kStamps ? gnss_.latency_s : 0.0,
                        by == Meeting::kTags     ? std::min(gnss_.latency_sd_s, kTaggedLatencySd_s)
                        : by == Meeting::kPulses ? std::min(gnss_.latency_sd_s, kStreamDelaySd_s)
                                                 : gnss_.latency_sd_s);
  } else if (by == Meeting::kStamps && gnss_.latency_sd_s > 0.0 && time > latency_time_) {
    const double wander_s = kLatencyWalk_s_per_sqrt_s * std::sqrt(to_seconds(time - latency_time_));
    core_.predict_state(latency, 1.0, wander_s * wander_s);
  }
  latency_time_ = std::max(latency_time_, time);
}

/// UTC of the rows by what has been found.
void NavigationFilter::tell_latency() noexcept {
  const double sd_s = core_.sd(core_.antenna_states() + kReceiverLatencyError);
  const double latency_s = core_.antenna().latency_s;
  if (meeting_ == Meeting::kStamps)
    utc_scale_.set_found_delay(UtcSource::kGnss, latency_s - gnss_.latency_s, sd_s);
  if (meeting_ == Meeting::kPulses) utc_scale_.set_found_delay(UtcSource::kPulses, latency_s, sd_s);
}

/// In a leap second the tags of two devices may be a second apart: one repeats the last second of the day,
/// another the first of the next. What lies between the solution by its own clock map and by its tag says so.
HostTime NavigationFilter::plausible_time(const Sample& gnss, HostTime time) noexcept {
  using namespace std::chrono_literals;
  if (!gnss.has_utc || !last_has_utc_) return time;
  const Duration time_of_day = gnss.utc - std::chrono::floor<std::chrono::days>(gnss.utc);
  const Duration lag = gnss.time - time;
  const bool near_midnight = time_of_day < kAroundMidnight || time_of_day > 24h - kAroundMidnight;
  if (!near_midnight && time <= gnss.arrival + kLagWanders) gnss_lag_ = lag;
  if (!gnss_lag_) return time;
  // Solved after it arrived: the receiver's UTC has jumped. Its own clock map goes on.
  if (time > gnss.arrival + kLagWanders) return gnss.time - *gnss_lag_;
  const Duration off = lag - *gnss_lag_;
  if (std::chrono::abs(off - 1s) < kLagWanders) return time + 1s;
  if (std::chrono::abs(off + 1s) < kLagWanders) return time - 1s;
  return time;
}

NavigationFilter::Lookup NavigationFilter::look_back(HostTime time, Delayed& out) const noexcept {
  if (past_size_ == 0 || time > past(0).time + kGnssAhead) return Lookup::kTooNew;
  if (time < past(past_size_ - 1).time) return Lookup::kTooOld;
  out.back.setIdentity();
  // E-4: what has been learned since epoch k was written, as an error then. Only the ring's span is walked:
  // carried along for hours instead, the vertical channel would grow by e every ten minutes.
  NavigationErrorVector learned = core_.injected();
  std::size_t k = 0;
  for (; past(k).time > time; ++k) {
    const PastEpoch& step = past(k);
    // [x_k; b] = [A B; 0 D] [x_k-1; b_k-1], undone from the left.
    const Eigen::Matrix<double, 9, 9> A_inverse = step.kinematic_rows.leftCols<9>().inverse();
    const auto undo = [&](auto& error) {
      error.template middleRows<3>(kGyroBiasError) /= step.gyro_bias_decay;
      error.template middleRows<3>(kAccelBiasError) /= step.accel_bias_decay;
      error.template topRows<9>() =
          (A_inverse * (error.template topRows<9>() -
                        step.kinematic_rows.rightCols<6>() * error.template bottomRows<6>()))
              .eval();
    };
    undo(out.back);
    undo(learned);
    learned += past(k + 1).injected;
  }
  const PastEpoch& epoch = past(k);
  out.state = epoch.state;
  out.measured = epoch.measured;
  // E-5: the state then
  inject(out.state, learned);
  const double rest_s = to_seconds(time - epoch.time);
  double share_of_newer = 0.0;
  if (rest_s > 0.0) {
    if (k > 0) {
      const PastEpoch& after = past(k - 1);
      share_of_newer = rest_s / to_seconds(after.time - epoch.time);
      out.measured = measured_between(k, share_of_newer);
    }
    propagate(out.state, increment_from_samples(compensated(epoch.measured, out.state),
                                                compensated(out.measured, out.state), rest_s));
  }
  set_arm_rate(k, share_of_newer, out);
  return Lookup::kFound;
}

bool NavigationFilter::apply_gnss(const Sample& sample) noexcept {
  const GnssData& gnss = sample.gnss;
  const bool has_velocity = gnss_.use_velocity && (gnss.flags & kVelocityValid) != 0;
  const GeodeticPosition antenna{gnss.latitude_rad, gnss.longitude_rad, gnss.height_m};
  // A receiver may call valid what is nowhere, and no gate stands before its first position.
  const bool claims_position = (gnss.flags & kPositionValid) != 0;
  const bool has_position = claims_position && is_on_earth(antenna);
  const Vector3d sd_position = trusted_position_sd(gnss, gnss_);
  const Vector3d sd_velocity = trusted_velocity_sd(gnss, gnss_);
  if (!has_last_) return true;
  const Met told = met(sample);
  const HostTime stamped = plausible_time(sample, told.time);
  carry_latency(told.by, stamped);
  const double latency_s = core_.antenna().latency_s;
  const Vector3d arm = core_.antenna().r_ba_b_m;
  const HostTime time = stamped - from_seconds(latency_s);
  const double widened = correlated_sd_factor(gnss.solution, to_seconds(time - last_position_));

  if (!navigating()) {
    if (navigation_.initial_rpy_rad && has_position) {
      NavigationState state;
      const Vector3& rpy = *navigation_.initial_rpy_rad;
      state.C_b_n = rotation_from_euler({rpy[0], rpy[1], rpy[2]});
      state.position = displaced(antenna, -(state.C_b_n * arm));
      NavigationErrorVector sd = NavigationErrorVector::Zero();
      sd.segment<3>(kPositionError) = sd_position;
      sd.segment<3>(kVelocityError).setConstant(kConfiguredStartVelocitySd_mps);
      sd.segment<3>(kAttitudeError) = to_eigen(navigation_.initial_rpy_sd_rad);
      start(state, sd, InitialisationMethod::kConfigured, last_time_);
      return true;
    }
    if (has_position) aligner_.add_gnss_position(time, antenna, sd_position);
    if (has_velocity) aligner_.add_gnss_velocity(time, to_eigen(gnss.v_n_mps), sd_velocity);
    if (claims_position && !has_position) {
      ++counters_.gnss_positions_rejected;
      ++counters_.gnss_rejected;
    }
    return true;
  }

  Delayed then;
  switch (look_back(time, then)) {
    case Lookup::kTooNew:
      return false;
    case Lookup::kTooOld:
      ++counters_.gnss_too_old;
      return true;
    case Lookup::kFound:
      break;
  }
  bool used = false;
  if (has_position) {
    const GnssInnovation position = gnss_position_innovation(then.state, antenna, arm);
    used = apply(position_gate_, position, antenna_in_position(then.state, then.measured, arm), then.back,
                 widened * sd_position, time, output_.nis_position);
    if (!used) ++counters_.gnss_positions_rejected;
    watch_consistency(time);
    if (used)
      inject(then.state,
             then.back * Eigen::Map<const NavigationErrorVector>(core_.covariance().correction().data()));
  } else if (claims_position) {
    ++counters_.gnss_positions_rejected;
  }
  if (has_velocity) {
    const Vector3d arm_now = core_.antenna().r_ba_b_m;
    GnssInnovation velocity =
        gnss_velocity_innovation(then.state, to_eigen(gnss.v_n_mps), then.measured.omega_ib_b_radps, arm_now);
    velocity.H.middleCols<3>(kGyroBiasError) *= then.rate_share;
    const AntennaMatrix of_antenna = antenna_in_velocity(then.state, then.measured, arm_now);
    const double swing_mps = then.sd_rate_radps * arm_now.norm();
    const Vector3d sd = (sd_velocity.array().square() + swing_mps * swing_mps).sqrt();
    // E-29: noisy gyros would shorten the arm
    CovarianceKernel::Considered considered;
    if (arm_rate_.half_width() > 0) considered = {core_.antenna_states() + kAntennaLeverArmError, 3};
    // The state then is of the latency that was believed before the position told more of it.
    velocity.innovation -= of_antenna.col(kReceiverLatencyError) * (core_.antenna().latency_s - latency_s);
    used =
        apply(velocity_gate_, velocity, of_antenna, then.back, sd, time, output_.nis_velocity, considered) ||
        used;
  }
  tell_latency();
  if (used) {
    ++counters_.gnss_used;
    output_.has_gnss = true;
    output_.gnss_time = time;
    if (streak_) {
      streak_ = false;
      log_.add(event::GnssReacquired{to_seconds(time - streak_start_)}, gnss_.device, time);
    }
  } else if (claims_position || has_velocity) {
    ++counters_.gnss_rejected;
    if (!streak_) {
      streak_ = true;
      streak_start_ = time;
      double nis = std::numeric_limits<double>::infinity();
      if (has_position || has_velocity)
        nis = has_position ? position_gate_.last_nis() : velocity_gate_.last_nis();
      log_.add(event::GnssRejected{nis}, gnss_.device, time);
    }
  }
  return true;
}

bool NavigationFilter::apply(GnssGate& gate, const GnssInnovation& measured, const AntennaMatrix& of_antenna,
                             const NavigationErrorCovariance& back, const Vector3d& sd, HostTime time,
                             Vector3& nis, CovarianceKernel::Considered considered) noexcept {
  // E-5: by the errors of now
  const NavigationMeasurementMatrix H = measured.H * back;
  SparseMeasurement sparse;
  append_columns(H, 0, sparse);
  append_columns(of_antenna, core_.antenna_states(), sparse);
  const Matrix3d R = sd.cwiseAbs2().asDiagonal();
  CovarianceKernel& P = core_.covariance();
  P.project(sparse, to_array(R));
  Matrix3d S = to_eigen(P.innovation_covariance());
  const GateDecision decision = gate.decide(time, measured.innovation, S, R);
  for (Eigen::Index i = 0; i < 3; ++i)
    nis[static_cast<std::size_t>(i)] = measured.innovation(i) * measured.innovation(i) / S(i, i);
  if (decision == GateDecision::kReject) return false;
  if (decision == GateDecision::kReacquire) {
    widen_for_reacquisition(measured.innovation);
    P.project(sparse, to_array(R));
  }
  return core_.update(measured.innovation, {true, true, true}, considered);
}

void NavigationFilter::watch_consistency(HostTime time) noexcept {
  const double dt_s = std::clamp(to_seconds(time - last_position_), 0.0, kConsistencyStep_s);
  last_position_ = time;
  watched_s_ += dt_s;
  const double improbable = position_gate_.last_nis() > kImprobableNis ? 1.0 : 0.0;
  improbable_share_ += dt_s / kConsistencyMean_s * (improbable - improbable_share_);
  if (inconsistent_told_ || watched_s_ < kConsistencyMean_s) return;
  if (improbable_share_ < kImprobableShareMax) return;
  inconsistent_told_ = true;
  log_.add(event::GnssInconsistent{improbable_share_}, gnss_.device, time);
}

void NavigationFilter::widen_for_reacquisition(const Vector3d& innovation) noexcept {
  const CovarianceKernel& P = core_.covariance();
  for (std::size_t i = 0; i < 3; ++i) {
    const double off = innovation(static_cast<Eigen::Index>(i));
    core_.reset_state(kPositionError + i, P(kPositionError + i, kPositionError + i) + off * off);
    core_.reset_state(kVelocityError + i, kReacquireVelocitySd_mps * kReacquireVelocitySd_mps);
  }
}

void NavigationFilter::update_output() noexcept {
  output_.time = last_time_;
  output_.utc = last_utc_;
  output_.has_utc = last_has_utc_;
  output_.gnss_contradicts = watched_s_ >= kConsistencyMean_s && improbable_share_ >= kImprobableShareMax;
  if (!navigating()) return;
  std::array<double, kNavigationStates> sd{};
  for (std::size_t i = 0; i < sd.size(); ++i) sd[i] = core_.sd(i);
  Matrix3d P_phi;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j)
      P_phi(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) =
          core_.covariance()(kAttitudeError + i, kAttitudeError + j);
  }
  // N-27a
  const ReferenceGrade& grade = reference_.grade;
  const double lean = grade.lean_sd_rad * grade.lean_sd_rad;
  const Vector3d floor(lean, lean, lean + grade.triad_sd_rad * grade.triad_sd_rad);
  const Matrix3d& C = core_.navigation().C_b_n;
  P_phi += C * floor.asDiagonal() * C.transpose();
  write_state(core_.navigation(), sd, P_phi, output_);
  const std::size_t antenna = core_.antenna_states();
  output_.antenna_lever_arm_b_m = to_array(core_.antenna().r_ba_b_m);
  for (std::size_t i = 0; i < 3; ++i)
    output_.sd_antenna_lever_arm_m[i] = core_.sd(antenna + kAntennaLeverArmError + i);
  output_.receiver_latency_s = core_.antenna().latency_s;
  output_.sd_receiver_latency_s = core_.sd(antenna + kReceiverLatencyError);
}

}  // namespace imuscope
