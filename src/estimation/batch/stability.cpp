#include "estimation/batch/stability.h"

#include <cmath>

namespace imuscope::batch {

namespace {

/// Each part must have this share of the information: the difference of a part that knows nothing is no
/// change.
constexpr double kLeastShare = 0.1;
constexpr Eigen::Index kLeastWindows = 10;

/// The bridge at one instant (B-25).
struct Bridge {
  WatchedVector sum = WatchedVector::Zero();
  WatchedVector share = WatchedVector::Zero();  ///< t, of the earlier part

  /// The components that both parts know something of.
  [[nodiscard]] Eigen::Array<bool, kWatched, 1> inside() const {
    return share.array() >= kLeastShare && share.array() <= 1.0 - kLeastShare;
  }
  [[nodiscard]] WatchedVector between() const {
    const WatchedVector t = share.cwiseMax(kLeastShare).cwiseMin(1.0 - kLeastShare);
    return t.cwiseProduct(WatchedVector::Ones() - t);
  }
  /// Of the components `seen`, by how many sd that is from zero which is farthest.
  [[nodiscard]] double statistic(const WatchedVector& variance,
                                 const Eigen::Array<bool, kWatched, 1>& seen) const {
    const WatchedVector sds = sum.cwiseAbs().cwiseQuotient(variance.cwiseProduct(between()).cwiseSqrt());
    return seen.select(sds.array(), 0.0).maxCoeff();
  }
};

/// Influences about the mean of each part.
WindowInfluences within_parts(WindowInfluences influences, Eigen::Index later) {
  const Eigen::Index n = influences.rows();
  influences.topRows(later).rowwise() -= influences.topRows(later).colwise().mean().eval();
  influences.bottomRows(n - later).rowwise() -= influences.bottomRows(n - later).colwise().mean().eval();
  return influences;
}

}  // namespace

Change largest_change(const WindowInfluences& influences, const WatchedVector& variance) {
  Change change;
  if (influences.rows() < kLeastWindows) return change;
  // Sums to zero but for the pull of the priors.
  const WatchedVector mean = influences.colwise().mean().transpose();
  const WatchedVector all = influences.cwiseAbs2().colwise().sum().transpose();
  Bridge at;
  Bridge widest;
  double largest = 0.0;
  for (Eigen::Index w = 0; w + 1 < influences.rows(); ++w) {
    // B-25: the bridge up to this window
    at.sum += influences.row(w).transpose() - mean;
    at.share += influences.row(w).cwiseAbs2().transpose().cwiseQuotient(all);
    const double statistic = at.statistic(variance, at.inside());
    if (!(statistic > largest)) continue;
    largest = statistic;
    widest = at;
    change.window = w + 1;
  }
  if (change.window == 0) return change;
  // A change adds to the scatter, more so in the shorter part: without it. A large one makes one part fit worse and
  // scatter more, which says nothing of what the other knows: the components are those of the search.
  const auto seen = widest.inside();
  const WindowInfluences within = within_parts(influences, change.window);
  widest.share = within.topRows(change.window)
                     .cwiseAbs2()
                     .colwise()
                     .sum()
                     .transpose()
                     .cwiseQuotient(within.cwiseAbs2().colwise().sum().transpose());
  change.statistic =
      widest.statistic(variance.cwiseMax(variance_of_sum(within, kLags).diagonal().eval()), seen);
  // B-25: d and s
  change.difference = -widest.sum.cwiseQuotient(widest.between());
  const WatchedVector farther = widest.share.cwiseMax(WatchedVector::Ones() - widest.share);
  change.reach = change.difference.cwiseProduct(farther);
  return change;
}

}  // namespace imuscope::batch
