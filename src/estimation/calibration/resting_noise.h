#pragma once

/// White noise of an R-IMU of which nobody said anything: what it shows where the vehicle rests. That it rests shows in
/// what is white, however noisy it is. EQUATIONS.md C-28. Core. Thread: one.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <optional>

namespace imuscope {

/// Of each triad the root of the power spectral density of its white noise, mean over axes.
struct WhiteNoise {
  double gyro_radps_per_sqrt_hz = 0.0;
  double accel_mps2_per_sqrt_hz = 0.0;
  double known_to = 0.0;  ///< sd of either density squared, as a share of it
};

class RestingNoise {
 public:
  /// @param rate_hz  of the R-IMU, > 0
  explicit RestingNoise(double rate_hz);

  /// One R sample. @param dt_s  since the one before; after a gap what was under way is left
  /// @return whether seen() has changed
  bool add(const Eigen::Vector3d& omega_radps, const Eigen::Vector3d& f_mps2, double dt_s) noexcept;
  /// Absent before the first whole window of rest. No less than the noise: what shakes the vehicle then counts as such.
  [[nodiscard]] const std::optional<WhiteNoise>& seen() const noexcept { return seen_; }

 private:
  /// Pieces between two whose difference would show motion.
  static constexpr std::size_t kFarApart = 10;

  struct Triad {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();   ///< of the piece under way
    std::array<Eigen::Vector3d, kFarApart> means{};  ///< of the newest pieces, in a ring
    double neighbours = 0.0;                         ///< sum of squared differences of neighbouring pieces
    double far_apart = 0.0;                          ///< and of those that are kFarApart from each other
    double pairs = 0.0;  ///< and of pairs of neighbours, each piece in one of them
    double quiet = 0.0;  ///< `pairs` of a window, mean over the quiet ones
    void end_piece(std::size_t piece, double samples) noexcept;
    [[nodiscard]] bool is_white() const noexcept;
  };
  void restart() noexcept;
  bool end_piece() noexcept;
  bool end_window() noexcept;
  /// @param pairs  of a window
  [[nodiscard]] double density(double pairs) const noexcept;

  double rate_hz_;
  std::size_t samples_per_piece_;
  std::size_t samples_ = 0;  ///< of the piece under way
  std::size_t pieces_ = 0;   ///< of the window under way
  Triad gyro_;
  Triad accel_;
  std::size_t quiet_windows_ = 0;
  std::optional<WhiteNoise> seen_;
};

}  // namespace imuscope
