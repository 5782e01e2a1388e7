#include "estimation/calibration/regime_detector.h"

#include <algorithm>
#include <cmath>

namespace imuscope {

void RegimeDetector::add(const Eigen::Vector3d& omega_radps, const Eigen::Vector3d& f_mps2,
                         double dt_s) noexcept {
  if (!started_) {
    started_ = true;
    omega_ = mean_omega_ = omega_radps;
    f_ = mean_f_ = f_mps2;
    return;
  }
  const auto gain = [dt_s](double time_constant_s) { return std::min(1.0, dt_s / time_constant_s); };
  omega_ += gain(kSmoothing_s) * (omega_radps - omega_);
  f_ += gain(kSmoothing_s) * (f_mps2 - f_);
  mean_omega_ += gain(kMean_s) * (omega_ - mean_omega_);
  mean_f_ += gain(kMean_s) * (f_ - mean_f_);
  omega_variance_ += gain(kSpread_s) * ((omega_ - mean_omega_).squaredNorm() - omega_variance_);
  f_variance_ += gain(kSpread_s) * ((f_ - mean_f_).squaredNorm() - f_variance_);
  wheels_age_s_ += dt_s;
  const bool has_wheels = wheels_age_s_ < kWheelsValid_s;
  wheels_stood_s_ = has_wheels && wheels_stand_ ? wheels_stood_s_ + dt_s : 0.0;
  const double room = wheels_stood_s_ >= kHold_s ? kShaking : 1.0;
  const double rate_limit = room * kRateLimit_radps;
  const double force_limit = room * kForceLimit_mps2;
  const bool wheels_turn = has_wheels && !wheels_stand_;
  const bool quiet =
      !wheels_turn && omega_variance_ < rate_limit * rate_limit && f_variance_ < force_limit * force_limit;
  quiet_s_ = quiet ? quiet_s_ + dt_s : 0.0;
  regime_ = quiet_s_ >= kHold_s ? Regime::kStatic : Regime::kDynamic;
}

void RegimeDetector::add_wheel_speed(double speed_mps) noexcept {
  wheels_age_s_ = 0.0;
  wheels_stand_ = std::abs(speed_mps) <= kWheelsStand_mps;
}

}  // namespace imuscope
