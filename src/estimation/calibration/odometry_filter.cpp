#include "estimation/calibration/odometry_filter.h"

#include <algorithm>
#include <cmath>

#include "estimation/calibration/axis_gate.h"
#include "estimation/calibration/s_imu_model.h"
#include "estimation/navigation/so3.h"

namespace imuscope {
namespace {

using Eigen::Vector3d;

/// Wheels that show less than this stand; a sensor that counts pulses shows exactly zero.
constexpr double kStanding_mps = 0.05;
/// For so long before it counts: longer than a braking vehicle needs from the sensors' dead band to rest.
constexpr Duration kStandingHold = std::chrono::seconds{1};
/// Rest is used this much later, when the wheels still stand: a vehicle that pulls away moves before its
/// wheel sensors show it.
constexpr Duration kStandingConfirmed = std::chrono::milliseconds{500};
/// Periods without a speed after which it is lost, and the least time.
constexpr double kLostPeriods = 3.0;
constexpr double kLostAtLeast_s = 0.1;
/// A magnitude takes the sign of the predicted speed where that is certain by this many sd.
constexpr double kSignCertain = 3.0;
/// NIS is averaged over this time.
constexpr double kOdometryNisMean_s = 10.0;
/// A speed is told to be rejected after so many in a row: single ones are slip.
constexpr int kRejectedTold = 25;
/// Re-acquisition at standstill: velocity is uncertain by this much more than the contradiction.
constexpr double kReacquireSd_mps = 0.1;

std::array<double, 9> diagonal(const Vector3d& variances) noexcept {
  return {variances(0), 0.0, 0.0, 0.0, variances(1), 0.0, 0.0, 0.0, variances(2)};
}

}  // namespace

OdometryFilter::OdometryFilter(const EstimatorConfig& config, FilterCore& core,
                               const NavigationFilter& navigation, EventLog& log, EstimatorCounters& counters)
    : config_(config.odometry),
      core_(core),
      navigation_(navigation),
      log_(log),
      counters_(counters),
      gate_(axis_gate(config.gate_probability)),
      inflation_(inflated_variance(0.0, 1.0, config_.correlation_time_s, 1.0 / config_.rate_hz)) {
  output_.enabled = config_.enabled;
  inflation_ = std::max(inflation_, 1.0);
}

bool OdometryFilter::add(const Sample& sample) noexcept {
  ++counters_.odometry_samples;
  if (!std::isfinite(sample.odometry.speed_mps)) {
    ++counters_.odometry_not_finite;
    return false;
  }
  if (has_last_ && sample.time <= last_time_) {
    ++counters_.odometry_too_old;
    return false;
  }
  if (lost_) {
    lost_ = false;
    log_.add(event::OdometryReturned{to_seconds(sample.time - last_time_)}, config_.device, sample.time);
  }
  const bool stands = std::abs(sample.odometry.speed_mps) <= kStanding_mps;
  const bool continues = has_last_ && wheels_stand_;
  if (stands && !continues) {
    standing_since_ = sample.time;
    standstill_gate_ = GnssGate{};
  }
  wheels_stand_ = stands;
  output_.standing = stands && sample.time - standing_since_ >= kStandingHold;
  output_.lost = false;
  output_.has_speed = true;
  output_.time = sample.time;
  output_.speed_mps = sample.odometry.speed_mps;
  has_last_ = true;
  last_time_ = sample.time;
  if (pending_size_ == kPending) {
    std::copy(pending_.begin() + 1, pending_.end(), pending_.begin());
    --pending_size_;
    ++counters_.odometry_too_old;
  }
  pending_[pending_size_++] = sample;
  return true;
}

void OdometryFilter::process(HostTime time, Regime regime) noexcept {
  if (!config_.enabled) return;
  watch_silence(time);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < pending_size_; ++i) {
    if (pending_[i].time > time) {
      pending_[kept++] = pending_[i];
    } else if (navigation_.navigating()) {
      apply(pending_[i], regime);
    }
  }
  pending_size_ = kept;
}

void OdometryFilter::watch_silence(HostTime time) noexcept {
  if (!has_last_ || lost_) return;
  const double silence_s = to_seconds(time - last_time_);
  if (silence_s <= std::max(kLostPeriods / config_.rate_hz, kLostAtLeast_s)) return;
  lost_ = true;
  wheels_stand_ = false;
  output_.standing = false;
  output_.resting = false;
  output_.lost = true;
  log_.add(event::OdometryLost{silence_s}, config_.device, time);
}

void OdometryFilter::apply(const Sample& sample, Regime regime) noexcept {
  const bool stands = std::abs(sample.odometry.speed_mps) <= kStanding_mps;
  // Wheel sensors are blind to a slow creep: standing wheels say nothing of a speed, and for a rest the R-IMU
  // has to be quiet too.
  const bool rests = config_.use_zero_velocity && stands && regime == Regime::kStatic &&
                     sample.time - standing_since_ >= kStandingHold + kStandingConfirmed;
  output_.resting = rests;
  if (stands && !rests) return;
  const HostTime at = rests ? sample.time - kStandingConfirmed : sample.time;
  NavigationFilter::Delayed then;
  if (navigation_.look_back(at, then) != NavigationFilter::Lookup::kFound) {
    ++counters_.odometry_too_old;
    return;
  }
  predict(sample.time);
  if (rests) {
    apply_standstill(at, then);
  } else {
    apply_motion(sample, then);
  }
}

void OdometryFilter::predict(HostTime time) noexcept {
  if (has_predicted_ && time > predicted_to_) {
    // E-33
    const double q = config_.scale_walk_per_sqrt_s * config_.scale_walk_per_sqrt_s;
    core_.predict_state(core_.odometry_states() + kWheelScaleError, 1.0,
                        q * to_seconds(time - predicted_to_));
  }
  has_predicted_ = true;
  predicted_to_ = time;
}

OdometryFilter::Noise OdometryFilter::noise_of(const Vector3d& sd) const noexcept {
  const Vector3d plain = sd.cwiseAbs2();
  return {plain, inflation_ * plain};
}

// E-30, E-31
void OdometryFilter::apply_motion(const Sample& sample, const NavigationFilter::Delayed& then) noexcept {
  double speed_mps = sample.odometry.speed_mps;
  OdometryInnovation predicted =
      odometry_innovation(then.state, core_.odometry(), speed_mps, then.swing_omega_ib_b_radps);
  predicted.H.middleCols<3>(kGyroBiasError) *= then.swing_share.asDiagonal();
  const double forward_mps = predicted.predicted.x();
  const Vector3d omega = then.swing_omega_ib_b_radps - then.state.gyro_bias_b_radps;
  // Sideways acceleration of a turn, and the slip angle that goes with it.
  const double sideways_mps2 = std::abs(forward_mps * omega.z());
  const double slip_mps = config_.slip_rad_per_mps2 * sideways_mps2 * std::abs(forward_mps);
  const double swing_mps = then.sd_swing_radps * core_.odometry().r_bv_b_m.norm();
  const Noise noise = noise_of({std::hypot(config_.speed_sd_mps, swing_mps),
                                std::hypot(config_.sideways_sd_mps, slip_mps, swing_mps),
                                std::hypot(config_.upwards_sd_mps, swing_mps)});

  SparseMeasurement H;
  append_columns(NavigationMeasurementMatrix(predicted.H * then.back), 0, H);
  append_columns(predicted.H_odometry, core_.odometry_states(), H);
  CovarianceKernel& P = core_.covariance();
  P.project(H, diagonal(noise.inflated));
  const Vector3d S = to_eigen(P.innovation_covariance()).diagonal();
  const Vector3d S_plain = S - noise.inflated + noise.plain;

  Vector3d y = predicted.innovation;
  bool speed_means_something = std::abs(speed_mps) >= config_.dead_band_mps;
  if ((sample.odometry.flags & kSpeedHasNoSign) != 0) {
    speed_means_something =
        speed_means_something && std::abs(forward_mps) > kSignCertain * std::sqrt(S_plain(0));
    if (forward_mps < 0.0) y(0) = -speed_mps - forward_mps;
  }
  std::array<bool, 3> use{config_.use_speed && speed_means_something, config_.use_non_holonomic,
                          config_.use_non_holonomic};
  const double share = std::min(1.0, 1.0 / (kOdometryNisMean_s * config_.rate_hz));
  for (std::size_t i = 0; i < 3; ++i) {
    if (!use[i]) continue;
    const auto k = static_cast<Eigen::Index>(i);
    const double nis = y(k) * y(k) / S_plain(k);
    const bool accepted = nis <= gate_;
    if (i == 0) {
      note_speed(accepted, y(k), sample.time);
      ++(accepted ? counters_.odometry_speed_used : counters_.odometry_speed_rejected);
    } else {
      ++(accepted ? counters_.odometry_slip_used : counters_.odometry_slip_rejected);
    }
    output_.nis[i] += share * (nis - output_.nis[i]);
    use[i] = accepted;
  }
  core_.update(y, use);
}

// E-32
void OdometryFilter::apply_standstill(HostTime at, const NavigationFilter::Delayed& then) noexcept {
  const ZeroVelocityInnovation zero = zero_velocity_innovation(then.state);
  const Noise noise = noise_of(Vector3d::Constant(config_.zero_velocity_sd_mps));
  SparseMeasurement H;
  append_columns(NavigationMeasurementMatrix(zero.H * then.back), 0, H);
  CovarianceKernel& P = core_.covariance();
  P.project(H, diagonal(noise.inflated));
  Eigen::Matrix3d S = to_eigen(P.innovation_covariance());
  S.diagonal() += noise.plain - noise.inflated;
  const Eigen::Matrix3d R = noise.plain.asDiagonal();
  const GateDecision decision = standstill_gate_.decide(at, zero.innovation, S, R);
  if (decision == GateDecision::kReject) {
    ++counters_.zero_velocity_rejected;
    return;
  }
  if (decision == GateDecision::kReacquire) {
    // Standing for long and sure of a speed: it is the state that is wrong.
    for (std::size_t i = 0; i < 3; ++i) {
      const double off = std::hypot(zero.innovation(static_cast<Eigen::Index>(i)), kReacquireSd_mps);
      core_.reset_state(kVelocityError + i, P(kVelocityError + i, kVelocityError + i) + off * off);
    }
    P.project(H, diagonal(noise.inflated));
  }
  ++counters_.zero_velocity_used;
  core_.update(zero.innovation, {true, true, true});
}

void OdometryFilter::note_speed(bool accepted, double excess_mps, HostTime time) noexcept {
  if (!accepted) {
    if (rejected_in_a_row_++ == 0) streak_start_ = time;
    if (rejected_in_a_row_ == kRejectedTold) {
      streak_ = true;
      log_.add(event::OdometryRejected{excess_mps}, config_.device, time);
    }
    return;
  }
  rejected_in_a_row_ = 0;
  if (!streak_) return;
  streak_ = false;
  log_.add(event::OdometryAccepted{to_seconds(time - streak_start_)}, config_.device, time);
}

void OdometryFilter::update_output() noexcept {
  if (!config_.enabled) return;
  const OdometryState& state = core_.odometry();
  const std::size_t first = core_.odometry_states();
  output_.scale = state.scale;
  output_.sd_scale = core_.sd(first + kWheelScaleError);
  output_.mount_rad = to_array(log_so3(state.C_b_v));
  output_.sd_mount_rad = {0.0, core_.sd(first + kVehicleMountError),
                          core_.sd(first + kVehicleMountError + 1)};
  output_.r_bv_b_m = to_array(state.r_bv_b_m);
  for (std::size_t i = 0; i < 3; ++i) output_.sd_r_bv_b_m[i] = core_.sd(first + kVehicleLeverArmError + i);
}

}  // namespace imuscope
