#pragma once

/// Which samples make one measurement update, how much of the reference's noise is left in their mean, and
/// how much of what the reference shows is motion. C-13, C-15. Core: no allocation after construction.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>

#include "estimation/alignment/reference_window.h"
#include "estimation/calibration/s_imu_model.h"

namespace imuscope {

/// sd of noise in the mean of a window, for white noise of sd 1 on every R sample.
struct NoiseGains {
  double value = 1.0;
  double slope_per_s = 0.0;       ///< of the first derivative
  double curvature_per_s2 = 0.0;  ///< of the second
};

/// A Hann window of 2 n samples whose halves overlap with those of its neighbours: sin^2 + cos^2 = 1, so that
/// all samples together count alike. n = 1: every sample by itself.
[[nodiscard]] double window_weight(int n, int position) noexcept;
/// Sum of the squared weights over the square of their sum, times n.
[[nodiscard]] double window_white_share(int n) noexcept;

/// C-15: the differentiator's weights and the window's, one after the other.
/// @param n  S samples from one update to the next
[[nodiscard]] NoiseGains noise_gains(const ReferenceWindowOptions& reference, double study_rate_hz, int n);

/// How much of what the reference shows is motion, axis by axis of b. C-13.
class MotionShare {
 public:
  /// One row for each: w, w', w'', f, f'.
  enum Quantity : Eigen::Index { kRate, kRateSlope, kRateCurvature, kForce, kForceSlope, kQuantities };
  using Powers = Eigen::Matrix<double, kQuantities, 3>;

  /// Variances of the noise in the means of the present window.
  void set_noise(double rate_sd_radps, double force_sd_mps2, const NoiseGains& gains) noexcept;
  /// @param b  compensated with the R biases, which were as given: an estimate of a bias that moves is no
  ///           motion
  void add(const ReferenceMean& b, const Eigen::Vector3d& gyro_bias_radps,
           const Eigen::Vector3d& accel_bias_mps2, double spacing_s) noexcept;
  /// Whether the newest window shows motion can be said: against the mean of those before.
  [[nodiscard]] bool can_tell() const noexcept { return windows_ > 1; }
  /// The newest window shows motion at all.
  [[nodiscard]] bool moving() const noexcept { return moving_; }
  /// What the derivatives may take for motion: `b` with everything times its share; nothing where there is
  /// no motion.
  [[nodiscard]] ReferenceMean believed(const ReferenceMean& b) const noexcept;
  /// What the S-IMU is expected to show: rate and angular acceleration times their shares. Without motion all
  /// of the rate, which is a bias then, and no angular acceleration.
  [[nodiscard]] ReferenceMean expected(const ReferenceMean& b) const noexcept;
  [[nodiscard]] Eigen::Vector3d rate_slope_share() const noexcept;
  /// Share of the angular acceleration's power that is noise, over the motion so far. 1 before any.
  [[nodiscard]] double noise_in_rate_slope() const noexcept;
  /// Motion seen with the present window.
  [[nodiscard]] double motion_s() const noexcept { return motion_s_; }
  void clear() noexcept;

 private:
  [[nodiscard]] double share(Quantity quantity, Eigen::Index axis) const noexcept;

  Powers noise_ = Powers::Zero();
  Powers motion_ = Powers::Zero();  ///< power less noise, mean over motion
  Powers recent_ = Powers::Zero();  ///< power of the last seconds
  /// Slow means: of a rate at rest, which is a bias, and of the force, which is gravity.
  Eigen::Vector3d mean_omega_radps_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_f_mps2_ = Eigen::Vector3d::Zero();
  double mean_s_ = 0.0;
  std::uint64_t windows_ = 0;
  bool moving_ = false;
  double seen_s_ = 0.0;
  double motion_s_ = 0.0;
};

/// Chooses n from noise and motion: the shortest window that leaves little noise in the angular acceleration.
class WindowChoice {
 public:
  WindowChoice(const ReferenceWindowOptions& reference, double study_rate_hz);
  struct Window {
    int n;
    NoiseGains gains;
  };
  [[nodiscard]] const Window& now() const noexcept { return windows_[chosen_]; }
  /// @param configured  0: chosen here
  void fix(int configured);
  /// @return whether the window has changed
  bool choose(const MotionShare& share) noexcept;

 private:
  static constexpr std::size_t kWindows = 3;
  ReferenceWindowOptions reference_;
  double rate_hz_;
  std::array<Window, kWindows> windows_;
  std::size_t chosen_ = 0;
  bool fixed_ = false;
};

}  // namespace imuscope
