#include "firmware_sim/imu/wheel_speed.h"

#include <cmath>
#include <string>

namespace imusim {
namespace {

NoiseSource noise_of(const WheelErrors& errors, std::uint64_t seed, std::string_view name) {
  const AxisNoise noise{errors.white_sd_mps * errors.white_sd_mps,
                        {{errors.slow_sd_mps * errors.slow_sd_mps, 1.0 / errors.slow_tau_s}}};
  return {same_in_both(noise), RegimeSwitch::kContinuous, Random(seed, std::string(name) + "/wheel")};
}

}  // namespace

WheelSpeed::WheelSpeed(const Motion& motion, const Eigen::Vector3d& r_b_m, const WheelErrors& errors,
                       std::uint64_t seed, std::string_view name)
    : motion_(&motion), r_b_m_(r_b_m), errors_(errors), noise_(noise_of(errors, seed, name)) {}

double WheelSpeed::true_at(double t_s) const {
  const MotionState state = motion_->state_at(t_s);
  return (state.C_b_n.transpose() * velocity_at(state, r_b_m_)).x();
}

double WheelSpeed::shown_at(double t_s) {
  const double step_s = has_last_ ? t_s - last_t_s_ : 0.0;
  has_last_ = true;
  last_t_s_ = t_s;
  const double noise_mps = noise_.next(motion_->regime_at(t_s), step_s);
  const double speed_mps = true_at(t_s);
  if (std::abs(speed_mps) < errors_.dead_band_mps) return 0.0;
  const double shown_mps = (1.0 + errors_.scale) * speed_mps + noise_mps;
  return errors_.step_mps > 0.0 ? errors_.step_mps * std::round(shown_mps / errors_.step_mps) : shown_mps;
}

}  // namespace imusim
