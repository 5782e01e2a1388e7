#include "estimation/calibration/update_window.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/contracts.h"
#include "base/units.h"

namespace imuscope {
namespace {

using Eigen::Vector3d;

/// C-15. From one update to the next; vehicles as wholes move below 3 Hz, of which the first takes little. The
/// longest is for a reference as noisy as the sensors it is to judge.
constexpr std::array<double, 3> kSpacings_s{0.1, 0.2, 0.5};
/// A share of noise above this asks for a longer window, one below for a shorter.
constexpr double kTooNoisy = 0.03;
constexpr double kQuiet = 0.01;
/// Motion that a window is judged by.
constexpr double kJudged_s = 20.0;
/// Motion is what stands above its noise by this factor over the last seconds, on one axis of rate or force:
/// the mean square of twenty normal numbers exceeds it once in 1e6.
constexpr double kMotionFactor = 3.0;
constexpr double kRecent_s = 2.0;
/// The power of motion is that of the last minutes of motion.
constexpr double kMotionMean_s = 120.0;
/// A share is believed where motion stands above noise by this.
constexpr double kShareMin = 0.3;
/// Forces are held against their mean over this time: gravity is no motion. Rates likewise, where it is asked
/// whether there is motion: a bias is none, a turn is over by then.
constexpr double kForceMean_s = 10.0;
constexpr double kRateMean_s = 60.0;

/// Weights of the reference's samples in value, first and second derivative at the middle of its window.
std::array<std::vector<double>, 3> derivative_weights_of(const ReferenceWindowOptions& reference) {
  std::array<std::vector<double>, 3> weights;
  const auto points = static_cast<std::size_t>(reference.points);
  for (std::size_t i = 0; i < points; ++i) {
    ReferenceWindow window(reference);
    for (std::size_t k = 0; k < points; ++k) {
      Sample sample{};
      sample.kind = SampleKind::kImu;
      sample.time = HostTime{} + from_seconds(static_cast<double>(k) * reference.period_s);
      sample.imu.omega_radps[0] = k == i ? 1.0 : 0.0;
      window.push(sample);
    }
    ReferenceKinematics seen;
    const std::size_t half = points / 2;
    const HostTime middle = HostTime{} + from_seconds(static_cast<double>(half) * reference.period_s);
    IMUSCOPE_EXPECTS(window.evaluate(middle, seen) == ReferenceResult::kOk);
    weights[0].push_back(seen.omega_radps.x());
    weights[1].push_back(seen.omega_dot_radps2.x());
    weights[2].push_back(seen.omega_ddot_radps3.x());
  }
  return weights;
}

}  // namespace

// C-15: the window
double window_weight(int n, int position) noexcept {
  const double s = std::sin(0.5 * kPi * static_cast<double>(position) / n);
  return s * s;
}

// C-15: one window alone against its share of all
double window_white_share(int n) noexcept { return n == 1 ? 1.0 : 0.75; }

// C-15: noise of a window's mean
NoiseGains noise_gains(const ReferenceWindowOptions& reference, double study_rate_hz, int n) {
  // On the grid of the faster of the two.
  const double ratio = 1.0 / (reference.period_s * study_rate_hz);
  const int stride = std::max(1, static_cast<int>(std::lround(ratio)));
  const int halves = ratio < 1.0 ? std::max(1, static_cast<int>(std::lround(n * ratio))) : n;
  const auto weights = derivative_weights_of(reference);
  const auto length = static_cast<std::size_t>(2 * halves * stride) + weights[0].size();
  std::array<double, 3> gains{};
  for (std::size_t d = 0; d < gains.size(); ++d) {
    std::vector<double> response(length, 0.0);
    for (int k = 0; k < 2 * halves; ++k) {
      const double weight = window_weight(halves, k) / halves;
      for (std::size_t i = 0; i < weights[d].size(); ++i)
        response[static_cast<std::size_t>(k * stride) + i] += weight * weights[d][i];
    }
    double sum = 0.0;
    for (const double r : response) sum += r * r;
    gains[d] = std::sqrt(sum);
  }
  return {gains[0], gains[1], gains[2]};
}

void MotionShare::clear() noexcept { *this = MotionShare{}; }

// C-13: N
void MotionShare::set_noise(double rate_sd_radps, double force_sd_mps2, const NoiseGains& gains) noexcept {
  const auto square = [](double x) { return x * x; };
  noise_.row(kRate).setConstant(square(rate_sd_radps * gains.value));
  noise_.row(kRateSlope).setConstant(square(rate_sd_radps * gains.slope_per_s));
  noise_.row(kRateCurvature).setConstant(square(rate_sd_radps * gains.curvature_per_s2));
  noise_.row(kForce).setConstant(square(force_sd_mps2 * gains.value));
  noise_.row(kForceSlope).setConstant(square(force_sd_mps2 * gains.slope_per_s));
  recent_ = noise_;
  // Motion stays what it was; little of it is another's with another window.
  seen_s_ = std::min(seen_s_, kJudged_s);
  motion_s_ = 0.0;
  moving_ = false;
}

// C-13: P, over motion
void MotionShare::add(const ReferenceMean& b, const Vector3d& gyro_bias_radps,
                      const Vector3d& accel_bias_mps2, double spacing_s) noexcept {
  const Vector3d omega = b.omega_radps + gyro_bias_radps;
  const Vector3d f = b.f_mps2 + accel_bias_mps2;
  ++windows_;
  mean_s_ += spacing_s;
  mean_f_mps2_ += spacing_s / std::min(mean_s_, kForceMean_s) * (f - mean_f_mps2_);
  mean_omega_radps_ += spacing_s / std::min(mean_s_, kRateMean_s) * (omega - mean_omega_radps_);
  Powers power;
  power.row(kRate) = b.omega_radps.cwiseAbs2().transpose();
  power.row(kRateSlope) = b.omega_dot_radps2.cwiseAbs2().transpose();
  power.row(kRateCurvature) = b.omega_ddot_radps3.cwiseAbs2().transpose();
  power.row(kForce) = (f - mean_f_mps2_).cwiseAbs2().transpose();
  power.row(kForceSlope) = b.f_dot_mps3.cwiseAbs2().transpose();
  Powers spread = power;
  spread.row(kRate) = (omega - mean_omega_radps_).cwiseAbs2().transpose();
  recent_ += std::min(1.0, spacing_s / kRecent_s) * (spread - recent_);
  moving_ = false;
  for (const Quantity quantity : {kRate, kForce})
    moving_ = moving_ || (recent_.row(quantity).array() > kMotionFactor * noise_.row(quantity).array()).any();
  if (!moving_) return;
  seen_s_ += spacing_s;
  motion_s_ += spacing_s;
  motion_ += std::min(1.0, spacing_s / std::min(seen_s_, kMotionMean_s)) * (power - noise_ - motion_);
}

// C-13: s
double MotionShare::share(Quantity quantity, Eigen::Index axis) const noexcept {
  if (!moving_) return 0.0;
  const double motion = motion_(quantity, axis);
  const double share = motion / std::max(motion + noise_(quantity, axis), 1e-300);
  return share < kShareMin ? 0.0 : share;
}

// C-13: the motion in H
ReferenceMean MotionShare::believed(const ReferenceMean& b) const noexcept {
  ReferenceMean out = b;
  Vector3d of_rate;
  for (Eigen::Index i = 0; i < 3; ++i) {
    of_rate(i) = share(kRate, i);
    out.omega_radps(i) *= of_rate(i);
    out.omega_dot_radps2(i) *= share(kRateSlope, i);
    out.omega_ddot_radps3(i) *= share(kRateCurvature, i);
    out.f_mps2(i) = mean_f_mps2_(i) + share(kForce, i) * (b.f_mps2(i) - mean_f_mps2_(i));
    out.f_dot_mps3(i) *= share(kForceSlope, i);
  }
  out.omega_omega = of_rate.asDiagonal() * b.omega_omega * of_rate.asDiagonal();
  return out;
}

// C-13: the motion in the prediction
ReferenceMean MotionShare::expected(const ReferenceMean& b) const noexcept {
  ReferenceMean out = b;
  for (Eigen::Index i = 0; i < 3; ++i) {
    if (moving_) out.omega_radps(i) *= share(kRate, i);
    out.omega_dot_radps2(i) *= share(kRateSlope, i);
  }
  return out;
}

Vector3d MotionShare::rate_slope_share() const noexcept {
  return {share(kRateSlope, 0), share(kRateSlope, 1), share(kRateSlope, 2)};
}

double MotionShare::noise_in_rate_slope() const noexcept {
  const double noise = noise_.row(kRateSlope).sum();
  const double motion = std::max(0.0, motion_.row(kRateSlope).sum());
  return noise > 0.0 ? noise / (noise + motion) : 0.0;
}

WindowChoice::WindowChoice(const ReferenceWindowOptions& reference, double study_rate_hz)
    : reference_(reference), rate_hz_(study_rate_hz) {
  for (std::size_t i = 0; i < kWindows; ++i) {
    const int n = std::max(1, static_cast<int>(std::lround(kSpacings_s[i] * study_rate_hz)));
    windows_[i] = {n, noise_gains(reference, study_rate_hz, n)};
  }
}

void WindowChoice::fix(int configured) {
  if (configured == 0) return;
  fixed_ = true;
  chosen_ = 0;
  windows_[0] = {configured, noise_gains(reference_, rate_hz_, configured)};
}

// C-15: n, by the noise in the angular acceleration
bool WindowChoice::choose(const MotionShare& share) noexcept {
  if (fixed_ || share.motion_s() < kJudged_s) return false;
  const double noise = share.noise_in_rate_slope();
  if (noise > kTooNoisy && chosen_ + 1 < kWindows) {
    ++chosen_;
    return true;
  }
  if (chosen_ == 0 || noise >= kQuiet) return false;
  const double gain = windows_[chosen_ - 1].gains.slope_per_s / windows_[chosen_].gains.slope_per_s;
  if (noise * gain * gain >= kQuiet) return false;
  --chosen_;
  return true;
}

}  // namespace imuscope
