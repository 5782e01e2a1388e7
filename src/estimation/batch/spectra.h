#pragma once

/// Windows of a grid and their Fourier transforms. Windows of a half sine overlap by half: the squares of two
/// neighbours add to one at every instant, so that sums over windows and frequencies are those over time
/// (B-3).

#include <Eigen/Core>
#include <complex>
#include <vector>

namespace imuscope::batch {

/// How a grid is cut into windows, and which frequencies of them are used.
struct WindowPlan {
  Eigen::Index length = 0;           ///< instants a window, a power of two
  std::vector<Eigen::Index> starts;  ///< first instant of each
  Eigen::Index n_frequencies = 0;    ///< from zero up
  double frequency_step_hz = 0.0;

  [[nodiscard]] double frequency_hz(Eigen::Index k) const {
    return static_cast<double>(k) * frequency_step_hz;
  }
};

/// Windows over all stretches of valid instants, of the longest length that leaves enough of them.
/// @param valid    per instant of the grid
/// @param rate_hz  of the grid
/// @param top_hz   highest frequency that is used
[[nodiscard]] WindowPlan plan_windows(const std::vector<char>& valid, double rate_hz, double top_hz);

/// Windows of `length` over all stretches of valid instants.
[[nodiscard]] WindowPlan plan_windows_of(Eigen::Index length, const std::vector<char>& valid, double rate_hz,
                                         double top_hz);

/// Transforms of all columns of a series in all windows.
class Spectra {
 public:
  Spectra() = default;
  /// @param series  one row per instant, of the grid that `plan` was made for
  Spectra(const WindowPlan& plan, const Eigen::MatrixXd& series);

  /// Column `column`, window `window`, frequency `k`.
  [[nodiscard]] std::complex<double> at(Eigen::Index window, Eigen::Index k, Eigen::Index column) const {
    return values_(window * n_frequencies_ + k, column);
  }
  /// All columns at once.
  [[nodiscard]] auto row(Eigen::Index window, Eigen::Index k) const {
    return values_.row(window * n_frequencies_ + k);
  }

 private:
  Eigen::Index n_frequencies_ = 0;
  Eigen::Matrix<std::complex<double>, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> values_;
};

/// Transform of the window itself: what a constant of one leaves in each frequency.
[[nodiscard]] Eigen::VectorXcd window_spectrum(const WindowPlan& plan);

}  // namespace imuscope::batch
