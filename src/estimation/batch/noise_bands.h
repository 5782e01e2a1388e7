#pragma once

/// What is left when the motion is explained: its power by band of frequency, axis and window, learned from
/// the residuals themselves, so that nobody has to know a noise figure (B-10, B-11).

#include <Eigen/Core>
#include <vector>

#include "estimation/batch/spectra.h"

namespace imuscope::batch {

/// Windows that each instant is in: they overlap by half, and their squares add to one (B-3), so that the
/// mean square of a transform is half of the power.
inline constexpr double kWindowsPerInstant = 2.0;

/// Bands of a plan's frequencies: single frequencies at first, then a quarter wider each.
class Bands {
 public:
  Bands() = default;
  explicit Bands(Eigen::Index n_frequencies);

  [[nodiscard]] Eigen::Index size() const { return static_cast<Eigen::Index>(edges_.size()) - 1; }
  [[nodiscard]] Eigen::Index first(Eigen::Index band) const { return edges_[static_cast<std::size_t>(band)]; }
  [[nodiscard]] Eigen::Index end(Eigen::Index band) const {
    return edges_[static_cast<std::size_t>(band) + 1];
  }
  [[nodiscard]] Eigen::Index width(Eigen::Index band) const { return end(band) - first(band); }

 private:
  std::vector<Eigen::Index> edges_{0};
};

/// Residual power: of the whole record by band, and of each window about it.
class NoiseBands {
 public:
  NoiseBands() = default;
  /// @param residuals  rows as in Spectra: window by window, a frequency a row; six columns, gyro then accel
  /// @param taken      by band, how many numbers of gyros and accelerometers the parameters take (B-11b)
  NoiseBands(const Bands& bands, Eigen::Index n_windows, Eigen::Index n_frequencies,
             const Eigen::Matrix<std::complex<double>, Eigen::Dynamic, 6, Eigen::RowMajor>& residuals,
             const Eigen::MatrixX2d& taken);

  /// Power of axis 0 to 5 in a band over the record: variance of white noise of that density; rad^2/s^2,
  /// m^2/s^4.
  [[nodiscard]] double power(Eigen::Index band, Eigen::Index axis) const { return power_(band, axis); }
  /// All axes.
  [[nodiscard]] Eigen::Matrix<double, 6, 1> power(Eigen::Index band) const {
    return power_.row(band).transpose();
  }
  /// Of one window, drawn towards the record's: a window with more of it counts less.
  [[nodiscard]] double window_power(Eigen::Index window, Eigen::Index band, Eigen::Index axis) const {
    return window_power_(window * power_.rows() + band, axis);
  }
  [[nodiscard]] Eigen::Matrix<double, 6, 1> window_power(Eigen::Index window, Eigen::Index band) const {
    return window_power_.row(window * power_.rows() + band).transpose();
  }
  /// By how much more than the noise's own power both are, for weights that follow the residuals not to claim
  /// more than they know (B-11a).
  [[nodiscard]] double claimed(Eigen::Index band) const { return claimed_[band]; }
  [[nodiscard]] Eigen::Index windows() const {
    return power_.rows() > 0 ? window_power_.rows() / power_.rows() : 0;
  }

 private:
  Eigen::Matrix<double, Eigen::Dynamic, 6> power_;
  Eigen::Matrix<double, Eigen::Dynamic, 6> window_power_;
  Eigen::VectorXd claimed_;
};

}  // namespace imuscope::batch
