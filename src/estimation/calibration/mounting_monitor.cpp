#include "estimation/calibration/mounting_monitor.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <chrono>
#include <cmath>

#include "base/calibration_levels.h"
#include "base/units.h"
#include "estimation/calibration/events.h"
#include "estimation/calibration/update_window.h"
#include "estimation/navigation/so3.h"
#include "sample/eigen_arrays.h"

namespace imuscope {
namespace {

using Eigen::Vector3d;

/// Nothing is called calibrated or observable where more than a third of the sd comes from what the
/// reference's noise takes of the lever arm.
constexpr double kAttenuationMax = 0.3;
/// Weight of the class, in imperfections seen, against what the drive shows; as the batch estimate has it.
constexpr double kClassWeight = 3.0;
/// Share of its prior's variance that must have been learned of an imperfection for it to be held against it.
constexpr double kLearnedMin = 0.05;
/// Over so much motion innovations are held against their predicted variance. White ones have it to 2 % then;
/// with twice the variance every sd is too small by 1.4, and nothing of it is called calibrated or observable
/// until they fit again.
constexpr double kNoiseMean_s = 60.0;
constexpr double kNoiseTooSmall = 2.0;
constexpr double kNoiseFits = 1.5;
/// Where the state's own share of an innovation's variance is below this, what is too much of it is noise.
constexpr double kNoiseRules = 0.2;
/// Innovations have more than their variance where their mean square exceeds 1 by so many of its own sd.
constexpr double kSurplusSds = 3.0;
/// No noise is ten times the configured one: then the device is not what is configured.
constexpr double kSurplusMax = 100.0;
/// When this share of the samples of the last seconds had a gated axis, the S-IMU sits differently.
constexpr double kMountingChangedShare = 0.8;
constexpr double kMountingWatch_s = 3.0;
/// A silence counts as no more than this: what nobody saw speaks neither for a mounting nor against it. A cable that is
/// pulled out with a jerk, and put back, has not moved the S-IMU.
constexpr double kUnseenMost_s = 0.5;
/// A good S-IMU has one sample in 20 000 gated. Above the first share of half a minute's motion its samples
/// do not fit any mounting; below the second, which takes two minutes of motion that fits, they do again.
constexpr double kMisfitMean_s = 30.0;
constexpr double kMisfitShare = 0.1;
constexpr double kFitShare = 0.002;
/// It is told only above this share: a mount that was turned is noticed as such first.
constexpr double kMisfitToldShare = 0.2;
/// Motion that a new mounting is held against before anything of it is called observable.
constexpr double kProof_s = 20.0;
/// Less than this share of the prior left: observable.
constexpr double kObservableShare = 0.5;
/// Two values that differ by more than this many sd of their difference are not the same.
constexpr double kContradictionSds = 5.0;
/// A boresight is compared with the configured one once it is known to this.
constexpr double kComparableBoresightSd_rad = 1.0 * kRadPerDeg;
/// Biases are compared with those before a silence after so long.
constexpr Duration kBiasSettles = std::chrono::seconds{20};
/// At rest, for so long, the mean force of a healthy accelerometer differs from gravity by less than this.
/// Samples further apart are not averaged.
constexpr double kRestForGravity_s = 5.0;
constexpr double kStudyGravityTolerance_mps2 = 1.0;
constexpr double kRestGap_s = 0.1;

/// Largest |a - b| in units of the sd of the difference.
double largest_contradiction(const Vector3& a, const Vector3& sd_a, const Vector3& b, const Vector3& sd_b) {
  double largest = 0.0;
  for (std::size_t i = 0; i < 3; ++i)
    largest = std::max(largest, std::abs(a[i] - b[i]) / std::hypot(sd_a[i], sd_b[i]));
  return largest;
}

double distance(const Vector3& a, const Vector3& b) { return (to_eigen(a) - to_eigen(b)).norm(); }

}  // namespace

void MountingMonitor::begin(const PriorSd& prior) noexcept {
  prior_ = prior;
  gated_ = {};
  gated_share_ = 0.0;
  proof_s_ = 0.0;
  contradiction_ = {};
  surplus_ = {};
}

void MountingMonitor::watch_gravity(const Sample& sample, Regime regime, double dt_s,
                                    const SImuConfig& config, EventLog& log) noexcept {
  if (regime != Regime::kStatic || (sample.imu.flags & kAccelValid) == 0) {
    resting_s_ = 0.0;
    resting_f_mps2_.setZero();
    return;
  }
  if (gravity_told_ || dt_s > kRestGap_s) return;
  resting_s_ += dt_s;
  if (resting_s_ <= 0.0) return;
  resting_f_mps2_ += dt_s / resting_s_ * (to_eigen(sample.imu.f_mps2) - resting_f_mps2_);
  if (resting_s_ < kRestForGravity_s) return;
  if (std::abs(resting_f_mps2_.norm() - kNominalGravity_mps2) < kStudyGravityTolerance_mps2) return;
  gravity_told_ = true;
  log.add(event::GravityMagnitudeWrong{resting_f_mps2_.norm()}, config.device, sample.time);
}

// C-24: where innovations have long been larger than the noise allows, the noise is what they say; and it is
// told.
double MountingMonitor::Surplus::factor(std::size_t axis) const noexcept {
  if (updates[axis] == 0.0) return 1.0;
  return std::clamp(nis[axis] / (1.0 + kSurplusSds * std::sqrt(2.0 / updates[axis])), 1.0, kSurplusMax);
}

void MountingMonitor::Surplus::add(std::size_t axis, double nis_of_update, double updates_max) noexcept {
  updates[axis] = std::min(updates[axis] + 1.0, updates_max);
  nis[axis] += (nis_of_update - nis[axis]) / updates[axis];
}

Vector3d MountingMonitor::noise_factor(Triad triad, Regime regime) const noexcept {
  const Surplus& surplus = surplus_[static_cast<std::size_t>(regime)][static_cast<std::size_t>(triad)];
  return {surplus.factor(0), surplus.factor(1), surplus.factor(2)};
}

void MountingMonitor::watch_update(const Update& update, const SImuConfig& config, EventLog& log) noexcept {
  const auto triad = static_cast<std::size_t>(update.triad);
  const Vector3d& y = update.y;
  Surplus& surplus = surplus_[static_cast<std::size_t>(update.regime)][triad];
  Contradiction& seen = contradiction_[triad];
  const double n = update.samples;
  gated_[triad] = false;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    if (update.clipped[i]) continue;
    gated_[triad] = gated_[triad] || !update.used[i];
    // What is beyond the gate counts as if at it: outliers tell little, a noise that is far off shows all the
    // same.
    surplus.add(i, std::min(y(k) * y(k), update.gate * update.S(k)) / update.plain(k),
                kNoiseMean_s * config.rate_hz / n);
    // At rest there is less noise, a sample that was gated is no noise, and while the state is uncertain
    // innovations tell of it.
    const bool tells =
        update.regime != Regime::kStatic && update.used[i] && update.known(k) < kNoiseRules * update.S(k);
    if (!tells) continue;
    seen.seen[i] += n;
    const double share = n / std::min(seen.seen[i], kNoiseMean_s * config.rate_hz);
    seen.nis[i] += share * (y(k) * y(k) / update.plain(k) - seen.nis[i]);
    const double excess_of_sample = n / window_white_share(update.samples) * (y(k) * y(k) - update.plain(k));
    seen.excess[i] += share * (excess_of_sample - seen.excess[i]);
  }
  watch_noise(update, config, log);
}

void MountingMonitor::watch_noise(const Update& update, const SImuConfig& config, EventLog& log) noexcept {
  Contradiction& noise = contradiction_[static_cast<std::size_t>(update.triad)];
  const auto worst = static_cast<std::size_t>(std::ranges::max_element(noise.nis) - noise.nis.begin());
  if (noise.nis[worst] < kNoiseFits) noise.is_too_small = noise.is_told = false;
  noise.is_too_small = noise.is_too_small || noise.nis[worst] >= kNoiseTooSmall;
  // By then what was not known at first has left the mean.
  const bool settled = noise.seen[worst] >= kNoiseMean_s * config.rate_hz;
  if (noise.is_told || !noise.is_too_small || !settled) return;
  noise.is_told = true;
  const bool gyro = update.triad == Triad::kGyro;
  const auto& configured =
      (gyro ? config.noise.gyro : config.noise.accel)[static_cast<std::size_t>(update.regime)];
  const double white = configured.white_sd[worst];
  log.add(event::NoiseTooSmall{gyro, std::sqrt(noise.nis[worst]),
                               std::sqrt(white * white + std::max(0.0, noise.excess[worst]))},
          config.device, update.time);
}

// E-9: biases before and after a silence.
void MountingMonitor::note_return(const SImuOutput& before, HostTime now, double silence_s,
                                  const SImuConfig& config, EventLog& log) noexcept {
  log.add(event::SImuReturned{silence_s}, config.device, now);
  before_silence_ = BiasesThen{now + kBiasSettles, before.gyro_bias_radps, before.sd_gyro_bias_radps,
                               before.accel_bias_mps2, before.sd_accel_bias_mps2};
}

void MountingMonitor::watch_return(const SImuOutput& now, const SImuConfig& config, EventLog& log) noexcept {
  if (!before_silence_ || now.time < before_silence_->compare_at) return;
  const BiasesThen then = *before_silence_;
  before_silence_.reset();
  if (largest_contradiction(now.gyro_bias_radps, now.sd_gyro_bias_radps, then.gyro_radps,
                            then.sd_gyro_radps) > kContradictionSds) {
    log.add(event::GyroBiasChanged{distance(now.gyro_bias_radps, then.gyro_radps)}, config.device, now.time);
  }
  if (largest_contradiction(now.accel_bias_mps2, now.sd_accel_bias_mps2, then.accel_mps2,
                            then.sd_accel_mps2) > kContradictionSds) {
    log.add(event::AccelBiasChanged{distance(now.accel_bias_mps2, then.accel_mps2)}, config.device, now.time);
  }
}

// E-8: what was found against what is configured.
void MountingMonitor::watch_priors(const SImuOutput& now, const SImuConfig& config, EventLog& log) noexcept {
  if (!lever_arm_told_ && largest_contradiction(now.r_bs_b_m, now.sd_r_bs_b_m, config.prior_r_bs_b_m,
                                                config.prior_r_bs_b_sd_m) > kContradictionSds) {
    lever_arm_told_ = true;
    log.add(event::LeverArmPriorWrong{distance(now.r_bs_b_m, config.prior_r_bs_b_m)}, config.device,
            now.time);
  }
  const bool comparable = to_eigen(now.sd_psi_rad).maxCoeff() < kComparableBoresightSd_rad;
  if (boresight_told_ || !config.prior_C_b_s || !comparable) return;
  const Vector3d off = log_so3(to_eigen(*config.prior_C_b_s).transpose() * to_eigen(now.C_b_s));
  if (largest_contradiction(to_array(off), now.sd_psi_rad, Vector3{}, config.prior_boresight_sd_rad) <=
      kContradictionSds)
    return;
  boresight_told_ = true;
  log.add(event::BoresightPriorWrong{off.norm()}, config.device, now.time);
}

bool MountingMonitor::fits_prior_of(const SImuConfig& other, const SImuOutput& now) noexcept {
  if (!other.prior_C_b_s) return false;
  const Vector3d off = log_so3(to_eigen(*other.prior_C_b_s).transpose() * to_eigen(now.C_b_s));
  return largest_contradiction(to_array(off), now.sd_psi_rad, Vector3{}, other.prior_boresight_sd_rad) <=
             kContradictionSds &&
         largest_contradiction(now.r_bs_b_m, now.sd_r_bs_b_m, other.prior_r_bs_b_m,
                               other.prior_r_bs_b_sd_m) <= kContradictionSds;
}

// E-19: samples with a gated axis.
void MountingMonitor::note_poor_alignment() noexcept {
  misfit_share_ = std::max(misfit_share_, kMisfitShare);
  misfits_ = true;
}

void MountingMonitor::watch_fit(Regime regime, bool gated, HostTime now, double seen_s,
                                const SImuConfig& config, EventLog& log) noexcept {
  // At rest everything fits: that is no evidence.
  if (regime == Regime::kStatic && !gated) return;
  proof_s_ += seen_s;
  misfit_share_ += seen_s / kMisfitMean_s * ((gated ? 1.0 : 0.0) - misfit_share_);
  if (misfit_share_ < kFitShare) misfits_ = misfit_told_ = false;
  misfits_ = misfits_ || misfit_share_ >= kMisfitShare;
  if (misfit_told_ || misfit_share_ < kMisfitToldShare) return;
  misfit_told_ = true;
  log.add(event::SImuInconsistent{misfit_share_}, config.device, now);
}

bool MountingMonitor::watch_mounting(const SImuOutput& now, const SImuLayout& layout, double dt_s,
                                     const SImuConfig& config, EventLog& log) noexcept {
  const bool gated = gated_[0] || gated_[1];
  const double seen_s = std::min(dt_s, kUnseenMost_s);
  watch_fit(now.regime, gated, now.time, seen_s, config, log);
  // A frozen mounting cannot be found anew.
  if (layout.psi == SImuLayout::kAbsent) return false;
  gated_share_ += seen_s / kMountingWatch_s * ((gated ? 1.0 : 0.0) - gated_share_);
  if (gated_share_ < kMountingChangedShare) return false;
  double worst = 0.0;
  for (std::size_t i = 0; i < 3; ++i) worst = std::max({worst, now.nis_gyro[i], now.nis_accel[i]});
  log.add(event::MountingChanged{worst}, config.device, now.time);
  return true;
}

// C-25: imperfections against what the class allows.
double MountingMonitor::watch_class(const FilterCore& core, std::size_t study,
                                    const SImuConfig& config) noexcept {
  const SImuState& state = core.study(study);
  const SImuLayout& layout = core.layout(study);
  double factor2 = 1.0;
  const auto look = [&](std::size_t first, std::size_t n, double sd, const auto& value) {
    if (first == SImuLayout::kAbsent || sd <= 0.0) return;
    double sum = 0.0;
    double largest = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      // An estimate scatters by what has been learned of it: its prior's variance less its own.
      const double learned = sd * sd - core.sd(first + i) * core.sd(first + i);
      if (learned < kLearnedMin * sd * sd) continue;
      const double share2 = value(i) * value(i) / learned;
      sum += share2;
      largest = std::max(largest, share2);
    }
    if (largest <= kContradictionSds * kContradictionSds) return;
    factor2 = std::max(factor2, (kClassWeight + sum) / (kClassWeight + static_cast<double>(n)));
  };
  const Vector3d alpha = log_so3(state.accel_turn);
  const auto index = [](std::size_t i) { return static_cast<Eigen::Index>(i); };
  look(layout.gyro_axes, 3, config.prior_axes_sd_rad,
       [&](std::size_t i) { return state.gyro_axes(index(i)); });
  look(layout.accel_axes, 3, config.prior_axes_sd_rad,
       [&](std::size_t i) { return state.accel_axes(index(i)); });
  look(layout.accel_boresight, 3, config.prior_accel_boresight_sd_rad[0],
       [&](std::size_t i) { return alpha(index(i)); });
  look(layout.g_sensitivity, 9, config.prior_g_sensitivity_sd,
       [&](std::size_t i) { return state.g_sensitivity(index(i / 3), index(i % 3)); });
  beyond_class_ = std::sqrt(factor2);
  return beyond_class_;
}

// C-22: of the lever arm that noise takes, what is left unknown.
void MountingMonitor::watch_attenuation(const Vector3d& lost_m, const Vector3& sd_m) noexcept {
  for (std::size_t i = 0; i < 3; ++i)
    lever_arm_attenuated_[i] = std::abs(lost_m(static_cast<Eigen::Index>(i))) > kAttenuationMax * sd_m[i];
}

MountingMonitor::Verdict MountingMonitor::judge(const SImuOutput& now,
                                                const SImuLayout& layout) const noexcept {
  const MountingGoal& goal = now.goal;
  const bool noise_fits = !contradiction_[0].is_too_small && !contradiction_[1].is_too_small;
  const bool fits = !misfits_ && noise_fits && proof_s_ >= kProof_s;
  Verdict verdict;
  bool attenuated = false;
  for (std::size_t i = 0; i < 6; ++i) {
    const double sd = i < 3 ? now.sd_psi_rad[i] : now.sd_r_bs_b_m[i - 3];
    const double goal_sd = i < 3 ? goal.boresight_sd_rad : goal.lever_arm_sd_m;
    const bool blurred = i >= 3 && lever_arm_attenuated_[i - 3];
    attenuated = attenuated || blurred;
    verdict.observable[i] = fits && !blurred && (sd < kObservableShare * prior_.psi_r[i] || sd <= goal_sd);
  }
  verdict.t_d_observable =
      layout.t_d != SImuLayout::kAbsent && fits &&
      (now.sd_t_d_s < kObservableShare * prior_.t_d_s || now.sd_t_d_s <= goal.time_offset_sd_s);
  const bool estimates_mounting = layout.psi != SImuLayout::kAbsent || layout.r != SImuLayout::kAbsent;
  const bool meets = meets_goal(now.sd_psi_rad, now.sd_r_bs_b_m, goal);
  const bool of_its_class = beyond_class_ <= 1.0;
  verdict.is_calibrated = estimates_mounting && fits && meets && !attenuated && of_its_class;
  return verdict;
}

MountingMonitor::Weakest MountingMonitor::weakest_direction(const SImuOutput& now,
                                                            const SImuLayout& layout) const noexcept {
  Weakest out;
  if (layout.psi == SImuLayout::kAbsent || layout.r == SImuLayout::kAbsent) return out;
  Eigen::Matrix<double, 6, 6> scaled;
  for (std::size_t i = 0; i < 6; ++i) {
    for (std::size_t j = 0; j < 6; ++j)
      scaled(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) =
          now.covariance_psi_r[i * 6 + j] / (prior_.psi_r[i] * prior_.psi_r[j]);
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> solver(scaled);
  const auto weakest = solver.eigenvectors().col(5);
  Eigen::Index largest = 0;
  weakest.cwiseAbs().maxCoeff(&largest);
  for (std::size_t i = 0; i < 6; ++i) out.direction[i] = weakest(static_cast<Eigen::Index>(i));
  out.component = static_cast<SImuDirection>(largest);
  out.relative_sd = std::sqrt(std::max(0.0, solver.eigenvalues()(5)));
  return out;
}

}  // namespace imuscope
