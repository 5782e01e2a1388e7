#include "estimation/calibration/arm_rate.h"

#include <cmath>

namespace imuscope {
namespace {

/// Noise of less than this swings an arm of a metre by less than 1 mm/s, a twentieth of what is believed of a GNSS
/// velocity.
constexpr double kQuietRate_radps = 1e-3;
/// A vehicle turns, pitches and rolls below 3 Hz or so, of which a mean over 2 x 0.03 s keeps nearly all.
constexpr double kHalfWidth_s = 0.03;
/// Motion from which its power is known well enough, and what a rate is believed to be before.
constexpr double kLearnt_s = 10.0;
constexpr double kBeforeThat_radps = 0.2;

}  // namespace

ArmRate::ArmRate(double noise_radps, double rate_hz) noexcept
    : noise_variance_(noise_radps * noise_radps), learnt_from_(kLearnt_s * rate_hz) {
  if (noise_radps > kQuietRate_radps)
    half_width_ = static_cast<std::size_t>(std::lround(kHalfWidth_s * rate_hz));
}

void ArmRate::learn(const Eigen::Vector3d& mean_b_radps) noexcept {
  sum_of_squares_ += mean_b_radps.cwiseAbs2();
  count_ += 1.0;
}

double ArmRate::sd_of_mean_radps(std::size_t samples) const noexcept {
  return std::sqrt(noise_variance_ / static_cast<double>(samples));
}

// E-29
ArmRate::Estimate ArmRate::estimate(const Eigen::Vector3d& mean_b_radps, std::size_t samples,
                                    bool moves) const noexcept {
  if (!moves) return {Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), 0.0};
  if (count_ < learnt_from_) return {Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), kBeforeThat_radps};
  const double of_learned = noise_variance_ / static_cast<double>(2 * half_width_ + 1);
  const double of_mean = noise_variance_ / static_cast<double>(samples);
  Estimate out;
  const Eigen::Array3d turning = (sum_of_squares_.array() / count_ - of_learned).max(0.0);
  out.share = turning / (turning + of_mean);
  out.omega_b_radps = out.share.cwiseProduct(mean_b_radps);
  // What is left unknown of the true rate has the variance share * of_mean.
  out.sd_radps = std::sqrt(out.share.maxCoeff() * of_mean);
  return out;
}

}  // namespace imuscope
