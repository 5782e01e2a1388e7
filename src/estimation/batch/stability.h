#pragma once

/// Whether the parts of a drive agree: a sensor that was moved, a mount that gave way, a clock that jumped.
/// B-25 in EQUATIONS.md.

#include <Eigen/Core>
#include <algorithm>

namespace imuscope::batch {

/// What is looked at: psi, r and t_d, as they stand in the vector of parameters.
inline constexpr Eigen::Index kWatched = 7;
using WatchedVector = Eigen::Matrix<double, kWatched, 1>;
/// What each window adds to the estimate of them: its score times the covariance. One row per window.
using WindowInfluences = Eigen::Matrix<double, Eigen::Dynamic, kWatched>;

/// Where the drive falls into two parts that differ most.
struct Change {
  Eigen::Index window = 0;                           ///< first of the later part
  double statistic = 0.0;                            ///< of the component that differs most, in sd
  WatchedVector difference = WatchedVector::Zero();  ///< of the later part less the earlier
  WatchedVector reach = WatchedVector::Zero();       ///< how far the estimate may be from either part's value

  /// Chance reaches this in one drive of ten thousand: the largest of some hundred standard normal numbers,
  /// most of them much alike, in seven components.
  [[nodiscard]] bool is_told() const { return statistic > 5.0; }
};

/// @param variance  of the estimate of each component, as the noise gives it; what the windows scatter by
///                  within the two parts takes its place where that is more
/// Zero where there are too few windows for two parts.
[[nodiscard]] Change largest_change(const WindowInfluences& influences, const WatchedVector& variance);

/// Variance of the sum of the rows, of zero mean, that are correlated with up to `lags` neighbours
/// (Bartlett's weights; B-19).
template <typename Rows>
[[nodiscard]] auto variance_of_sum(const Rows& rows, Eigen::Index lags) {
  using Matrix = Eigen::Matrix<double, Rows::ColsAtCompileTime, Rows::ColsAtCompileTime>;
  Matrix sum = rows.transpose() * rows;
  for (Eigen::Index lag = 1; lag <= std::min(lags, rows.rows() - 1); ++lag) {
    const Eigen::Index n = rows.rows() - lag;
    const Matrix cross = rows.bottomRows(n).transpose() * rows.topRows(n);
    const double taper = 1.0 - static_cast<double>(lag) / static_cast<double>(lags + 1);
    sum += taper * (cross + cross.transpose());
  }
  return sum;
}

/// Windows whose scores are taken to be correlated, beyond the overlap: drifts outlast a window.
inline constexpr Eigen::Index kLags = 4;

}  // namespace imuscope::batch
