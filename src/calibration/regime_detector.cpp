#include "calibration/regime_detector.h"

#include <algorithm>

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
  const bool quiet = omega_variance_ < kRateLimit_radps * kRateLimit_radps &&
                     f_variance_ < kForceLimit_mps2 * kForceLimit_mps2;
  quiet_s_ = quiet ? quiet_s_ + dt_s : 0.0;
  regime_ = quiet_s_ >= kHold_s ? Regime::kStatic : Regime::kDynamic;
}

}  // namespace imuscope
