#include "estimation/calibration/filter_core.h"

#include <algorithm>
#include <cmath>

namespace imuscope {
namespace {

std::size_t filter_dimension(const EstimatorConfig& config) {
  std::size_t dimension = kNavigationStates;
  for (const SImuConfig& study : config.studies) dimension += SImuLayout::make(study.blocks, 0).size;
  if (config.odometry.enabled) dimension += kOdometryErrorSize;
  if (config.gnss.enabled) dimension += kAntennaErrorSize;
  return dimension;
}

/// Prior sd of the odometry's states.
std::array<double, kOdometryErrorSize> odometry_prior(const OdometryConfig& config) {
  const Vector3& arm = config.prior_r_bv_b_sd_m;
  return {
      config.prior_scale_sd, config.prior_mount_sd_rad, config.prior_mount_sd_rad, arm[0], arm[1], arm[2]};
}

/// Calls f(state index, prior sd) for every state of one S-IMU.
template <typename Function>
void for_each_prior(const SImuLayout& layout, const SImuConfig& config, Function f) {
  const auto block = [&](std::size_t first, const Vector3& sd) {
    if (first == SImuLayout::kAbsent) return;
    for (std::size_t i = 0; i < 3; ++i) f(first + i, sd[i]);
  };
  const auto bias = [&](std::size_t first, const Vector3& turn_on, const auto& process) {
    // C-17: turn-on and slow process together
    block(first, {std::hypot(turn_on[0], process[0].sd), std::hypot(turn_on[1], process[1].sd),
                  std::hypot(turn_on[2], process[2].sd)});
  };
  block(layout.psi, config.prior_boresight_sd_rad);
  block(layout.r, config.prior_r_bs_b_sd_m);
  bias(layout.gyro_bias, config.turn_on_gyro_sd_radps, config.noise.gyro_bias);
  bias(layout.accel_bias, config.turn_on_accel_sd_mps2, config.noise.accel_bias);
  if (layout.t_d != SImuLayout::kAbsent) f(layout.t_d, config.prior_t_d_sd_s);
  block(layout.gyro_scale, config.prior_gyro_scale_sd);
  block(layout.accel_scale, config.prior_accel_scale_sd);
  block(layout.accel_boresight, config.prior_accel_boresight_sd_rad);
  if (layout.accel_t_d != SImuLayout::kAbsent) f(layout.accel_t_d, config.prior_accel_t_d_sd_s);
  const auto alike = [&](std::size_t first, std::size_t count, double sd) {
    if (first == SImuLayout::kAbsent) return;
    for (std::size_t i = 0; i < count; ++i) f(first + i, sd);
  };
  alike(layout.gyro_axes, 3, config.prior_axes_sd_rad);
  alike(layout.accel_axes, 3, config.prior_axes_sd_rad);
  alike(layout.places, 6, config.prior_place_sd_m);
  alike(layout.g_sensitivity, 9, config.prior_g_sensitivity_sd);
  if (layout.reference_accel_t_d != SImuLayout::kAbsent)
    f(layout.reference_accel_t_d, config.prior_reference_accel_t_d_sd_s);
}

// Where a variance of the navigation is lost, these wide values stand in: m, m/s, rad.
constexpr std::array<double, 3> kRepairNavigationSd{100.0, 10.0, 0.1};

}  // namespace

FilterCore::FilterCore(const EstimatorConfig& config)
    : covariance_(filter_dimension(config), config.instruction_set) {
  repair_variance_.resize(covariance_.dimension());
  accumulated_.decay.resize(covariance_.dimension() - kNavigationStates);
  accumulated_.decay_noise.resize(covariance_.dimension() - kNavigationStates);
  accumulated_.injected.resize(covariance_.dimension());
  waiting_.resize(covariance_.dimension());
  study_waits_.resize(config.studies.size());
  restart_accumulation();
  for (std::size_t i = 0; i < 9; ++i)
    repair_variance_[i] = kRepairNavigationSd[i / 3] * kRepairNavigationSd[i / 3];
  const ReferenceConfig& reference = config.reference;
  const Vector3 accel_bias_sd = start_accel_bias_sd_mps2(reference);
  for (std::size_t i = 0; i < 3; ++i) {
    repair_variance_[kGyroBiasError + i] = reference.gyro_bias.sd * reference.gyro_bias.sd;
    repair_variance_[kAccelBiasError + i] = accel_bias_sd[i] * accel_bias_sd[i];
    covariance_.reset_state(kGyroBiasError + i, repair_variance_[kGyroBiasError + i]);
    covariance_.reset_state(kAccelBiasError + i, repair_variance_[kAccelBiasError + i]);
  }
  // E-1; after the S-IMUs the odometry's states (E-33) and the antenna's (N-34).
  std::size_t first = kNavigationStates;
  studies_.resize(config.studies.size());
  for (std::size_t i = 0; i < config.studies.size(); ++i) {
    layouts_.push_back(SImuLayout::make(config.studies[i].blocks, first));
    first += layouts_.back().size;
    for_each_prior(layouts_.back(), config.studies[i],
                   [this](std::size_t state, double sd) { repair_variance_[state] = sd * sd; });
    reset_to_prior(*this, i, config.studies[i]);
  }
  const auto append = [&](double sd) {
    repair_variance_[first] = sd * sd;
    covariance_.reset_state(first++, sd * sd);
  };
  if (config.odometry.enabled) {
    odometry_states_ = first;
    odometry_.r_bv_b_m = to_eigen(config.odometry.prior_r_bv_b_m);
    for (const double sd : odometry_prior(config.odometry)) append(sd);
  }
  if (config.gnss.enabled) {
    antenna_states_ = first;
    antenna_.r_ba_b_m = to_eigen(config.gnss.antenna_lever_arm_b_m);
    for (const double sd : config.gnss.antenna_lever_arm_sd_m) append(sd);
    antenna_.latency_s = config.gnss.latency_s;
    append(config.gnss.latency_sd_s);
  }
}

double FilterCore::sd(std::size_t state) const noexcept {
  return state == SImuLayout::kAbsent ? 0.0 : std::sqrt(covariance_(state, state));
}

bool FilterCore::update(const Eigen::Vector3d& innovation, const std::array<bool, 3>& use,
                        CovarianceKernel::Considered considered) noexcept {
  if (!covariance_.update(to_array(innovation), use, considered)) return false;
  ++changes_;
  const std::span<const double> correction = covariance_.correction();
  const Eigen::Map<const NavigationErrorVector> navigation_correction(correction.data());
  // E-4: as errors of now
  injected_ += navigation_correction;
  navigation_.gyro_bias_b_radps += navigation_correction.segment<3>(kGyroBiasError);
  navigation_.accel_bias_b_mps2 += navigation_correction.segment<3>(kAccelBiasError);
  if (keeps_history_) {
    for (std::size_t i = 0; i < correction.size(); ++i) accumulated_.injected[i] += correction[i];
  }
  for (std::size_t i = 0; i < correction.size(); ++i) waiting_[i] += correction[i];
  navigation_waits_ = true;
  std::fill(study_waits_.begin(), study_waits_.end(), 1);
  if (odometry_states_ != SImuLayout::kAbsent)
    inject(odometry_, Eigen::Map<const OdometryErrorVector>(correction.data() + odometry_states_));
  if (antenna_states_ != SImuLayout::kAbsent)
    inject(antenna_, Eigen::Map<const AntennaErrorVector>(correction.data() + antenna_states_));
  return true;
}

void FilterCore::reset_latency(double latency_s, double sd_s) noexcept {
  IMUSCOPE_EXPECTS(antenna_states_ != SImuLayout::kAbsent);
  antenna_.latency_s = latency_s;
  repair_variance_[antenna_states_ + kReceiverLatencyError] = sd_s * sd_s;
  reset_state(antenna_states_ + kReceiverLatencyError, sd_s * sd_s);
}

void FilterCore::settle() noexcept {
  settle_navigation();
  for (std::size_t i = 0; i < studies_.size(); ++i) settle_study(i);
}

void FilterCore::settle_navigation() noexcept {
  if (!navigation_waits_) return;
  navigation_waits_ = false;
  Eigen::Map<NavigationErrorVector> waiting(waiting_.data());
  // The biases have theirs already.
  waiting.segment<3>(kGyroBiasError).setZero();
  waiting.segment<3>(kAccelBiasError).setZero();
  inject(navigation_, waiting);
  waiting.setZero();
}

void FilterCore::settle_study(std::size_t i) noexcept {
  if (study_waits_[i] == 0) return;
  study_waits_[i] = 0;
  const SImuLayout& layout = layouts_[i];
  inject(studies_[i], layout, waiting_);
  std::fill_n(waiting_.begin() + static_cast<std::ptrdiff_t>(layout.first), layout.size, 0.0);
}

NavigationErrorVector FilterCore::take_injected() noexcept {
  NavigationErrorVector taken = injected_;
  injected_.setZero();
  return taken;
}

void FilterCore::predict_navigation(const NavigationTransition& step) noexcept {
  using Columns = Eigen::Matrix<double, KernelTransition::kStride, kNavigationErrorSize>;
  KernelTransition kernel;
  Eigen::Map<Columns, Eigen::Aligned64> phi(kernel.phi.data());
  phi.topRows<kNavigationKinematicSize>() = step.kinematic_rows;
  phi.diagonal().segment<3>(kGyroBiasError).setConstant(step.gyro_bias_decay);
  phi.diagonal().segment<3>(kAccelBiasError).setConstant(step.accel_bias_decay);
  Eigen::Map<Columns, Eigen::Aligned64>(kernel.noise.data()).topRows<kNavigationErrorSize>() =
      step.process_covariance;
  covariance_.predict_navigation(kernel);

  if (!keeps_history_) return;
  const auto carried_matrix = [&step](const NavigationErrorCovariance& M) {
    NavigationErrorCovariance out;
    // Lazily, coefficient by coefficient: at this size Eigen's blocked product spends more on its blocks.
    out.topRows<kNavigationKinematicSize>() = step.kinematic_rows.lazyProduct(M);
    out.middleRows<3>(kGyroBiasError) = step.gyro_bias_decay * M.middleRows<3>(kGyroBiasError);
    out.middleRows<3>(kAccelBiasError) = step.accel_bias_decay * M.middleRows<3>(kAccelBiasError);
    return out;
  };
  // E-10: since the epoch of the history before
  accumulated_.transition = carried_matrix(accumulated_.transition);
  accumulated_.noise =
      carried_matrix(carried_matrix(accumulated_.noise).transpose()) + step.process_covariance;
  Eigen::Map<NavigationErrorVector> injected(accumulated_.injected.data());
  const NavigationErrorVector before = injected;
  injected.head<kNavigationKinematicSize>().noalias() = step.kinematic_rows * before;
  injected.segment<3>(kGyroBiasError) *= step.gyro_bias_decay;
  injected.segment<3>(kAccelBiasError) *= step.accel_bias_decay;
}

void FilterCore::predict_state(std::size_t i, double decay, double variance) noexcept {
  predict_states(i, {&decay, 1}, {&variance, 1});
}

void FilterCore::predict_states(std::size_t first, std::span<const double> decay,
                                std::span<const double> variance) noexcept {
  covariance_.predict_states(first, decay, variance);
  if (!keeps_history_) return;
  for (std::size_t k = 0; k < decay.size(); ++k) accumulate(first + k, decay[k], variance[k]);
}

void FilterCore::reset_state(std::size_t i, double variance) noexcept {
  ++changes_;
  covariance_.reset_state(i, variance);
  // E-11. A decay to nothing: what was known before tells nothing of what comes after.
  if (keeps_history_) accumulate(i, 0.0, variance);
}

void FilterCore::accumulate(std::size_t i, double decay, double variance) noexcept {
  // A product with 0 would let a lost state's NaN through.
  const auto decayed = [decay](double value) { return decay == 0.0 ? 0.0 : decay * value; };
  accumulated_.injected[i] = decayed(accumulated_.injected[i]);
  if (i < kNavigationStates) {
    const auto k = static_cast<Eigen::Index>(i);
    NavigationErrorCovariance& noise = accumulated_.noise;
    for (Eigen::Index j = 0; j < kNavigationErrorSize; ++j) {
      accumulated_.transition(k, j) = decayed(accumulated_.transition(k, j));
      noise(k, j) = decayed(noise(k, j));
    }
    for (Eigen::Index j = 0; j < kNavigationErrorSize; ++j) noise(j, k) = decayed(noise(j, k));
    noise(k, k) += variance;
  } else {
    const std::size_t k = i - kNavigationStates;
    accumulated_.decay[k] *= decay;
    accumulated_.decay_noise[k] = decay * decay * accumulated_.decay_noise[k] + variance;
  }
}

void FilterCore::restart_accumulation() noexcept {
  accumulated_.transition.setIdentity();
  accumulated_.noise.setZero();
  std::fill(accumulated_.decay.begin(), accumulated_.decay.end(), 1.0);
  std::fill(accumulated_.decay_noise.begin(), accumulated_.decay_noise.end(), 0.0);
  std::fill(accumulated_.injected.begin(), accumulated_.injected.end(), 0.0);
}

std::size_t FilterCore::repair(std::size_t& first) noexcept {
  std::size_t count = 0;
  for (std::size_t i = 0; i < covariance_.dimension(); ++i) {
    const double variance = covariance_(i, i);
    if (variance >= 0.0 && std::isfinite(variance)) continue;
    if (count++ == 0) first = i;
    repair_state(i);
  }
  return count;
}

void reset_to_prior(FilterCore& core, std::size_t study, const SImuConfig& config) noexcept {
  SImuState& state = core.study(study);
  state = SImuState{};
  if (config.prior_C_b_s) state.C_b_s = to_eigen(*config.prior_C_b_s);
  state.r_bs_b_m = to_eigen(config.prior_r_bs_b_m);
  state.gyro_bias_s_radps = to_eigen(config.prior_gyro_bias_radps);
  state.accel_bias_s_mps2 = to_eigen(config.prior_accel_bias_mps2);
  state.t_d_s = config.prior_t_d_s.value_or(0.0);
  state.gyro_scale = to_eigen(config.prior_gyro_scale);
  state.accel_scale = to_eigen(config.prior_accel_scale);
  for_each_prior(core.layout(study), config,
                 [&core](std::size_t i, double sd) { core.reset_state(i, sd * sd); });
}

}  // namespace imuscope
