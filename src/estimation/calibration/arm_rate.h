#pragma once

/// The rate that swings a lever arm that is learned from its swing (the axle's), where the gyros are noisy. A measurement
/// through an arm,
/// v + w x l, has the rate in its matrix: noise of the rate would shorten the arm, as in every regression on a
/// noisy variable, and the filter would be sure of it. So the rate is a mean over some samples, brought
/// down to the best linear estimate of the true one by its own power beside that of its noise. EQUATIONS.md E-29.
/// Core. Thread: one.

#include <Eigen/Core>
#include <cstddef>

namespace imuscope {

class ArmRate {
 public:
  /// @param noise_radps  white noise of one sample, each axis
  ArmRate(double noise_radps, double rate_hz) noexcept;

  /// Samples on either side of an instant that make the mean; 0: the gyros are quiet, measured rates do.
  [[nodiscard]] std::size_t half_width() const noexcept { return half_width_; }

  /// Learns how much the vehicle turns while it moves.
  /// @param mean_b_radps  over 2 half_width() + 1 samples, bias taken off
  void learn(const Eigen::Vector3d& mean_b_radps) noexcept;

  /// Noise of a mean over so many samples, each axis.
  [[nodiscard]] double sd_of_mean_radps(std::size_t samples) const noexcept;

  struct Estimate {
    Eigen::Vector3d omega_b_radps;
    Eigen::Vector3d share;  ///< of the mean, each axis: 0 to 1
    double sd_radps;        ///< of the worst axis
  };
  /// Standing, none of it is turning.
  /// @param mean_b_radps  over so many samples, bias taken off
  [[nodiscard]] Estimate estimate(const Eigen::Vector3d& mean_b_radps, std::size_t samples,
                                  bool moves) const noexcept;

 private:
  double noise_variance_;
  double learnt_from_;  ///< samples
  std::size_t half_width_ = 0;
  Eigen::Vector3d sum_of_squares_ = Eigen::Vector3d::Zero();
  double count_ = 0.0;
};

}  // namespace imuscope
