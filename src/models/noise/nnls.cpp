#include "models/noise/nnls.h"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>

namespace imuscope::noise {
namespace {

/// A gradient below this, for unit columns, is rounding.
constexpr double kGradientRelative = 1e-13;
constexpr int kMaxChangesPerColumn = 6;

using Active = std::array<bool, kMaxColumns>;

/// The unconstrained solution over the active columns, zero elsewhere. False when they are dependent.
class GramSolver {
 public:
  GramSolver(const Gram& gram, const ColumnVector& projected) : gram_(gram), projected_(projected) {}

  [[nodiscard]] double tolerance() const { return kGradientRelative * projected_.cwiseAbs().maxCoeff(); }
  [[nodiscard]] ColumnVector gradient(const ColumnVector& x) const { return projected_ - gram_ * x; }

  bool solve(const Active& active, ColumnVector& z) const {
    std::array<Eigen::Index, kMaxColumns> index{};
    Eigen::Index k = 0;
    for (Eigen::Index i = 0; i < projected_.size(); ++i) {
      if (active[static_cast<std::size_t>(i)]) index[static_cast<std::size_t>(k++)] = i;
    }
    // Cholesky by hand: the matrices are 1 to 7 wide and there are thousands of them.
    std::array<std::array<double, kMaxColumns>, kMaxColumns> l{};
    std::array<double, kMaxColumns> v{};
    for (std::size_t i = 0; i < static_cast<std::size_t>(k); ++i) {
      for (std::size_t j = 0; j <= i; ++j) {
        double sum = gram_(index[i], index[j]);
        for (std::size_t m = 0; m < j; ++m) sum -= l[i][m] * l[j][m];
        if (i != j) {
          l[i][j] = sum / l[j][j];
          continue;
        }
        constexpr double kDependent = 1e-13;
        if (sum < kDependent) return false;
        l[i][i] = std::sqrt(sum);
      }
      double sum = projected_[index[i]];
      for (std::size_t m = 0; m < i; ++m) sum -= l[i][m] * v[m];
      v[i] = sum / l[i][i];
    }
    z.setZero(projected_.size());
    for (std::size_t i = static_cast<std::size_t>(k); i-- > 0;) {
      double sum = v[i];
      for (std::size_t m = i + 1; m < static_cast<std::size_t>(k); ++m) sum -= l[m][i] * v[m];
      v[i] = sum / l[i][i];
      z[index[i]] = v[i];
    }
    return true;
  }

 private:
  const Gram& gram_;
  const ColumnVector& projected_;
};

class QrSolver {
 public:
  QrSolver(const Design& a, const RowVector& y) : a_(a), y_(y) {}

  [[nodiscard]] double tolerance() const { return kGradientRelative * y_.norm(); }
  [[nodiscard]] ColumnVector gradient(const ColumnVector& x) const { return a_.transpose() * (y_ - a_ * x); }

  bool solve(const Active& active, ColumnVector& z) const {
    Design part(a_.rows(), a_.cols());
    std::array<Eigen::Index, kMaxColumns> index{};
    Eigen::Index k = 0;
    for (Eigen::Index i = 0; i < a_.cols(); ++i) {
      if (!active[static_cast<std::size_t>(i)]) continue;
      part.col(k) = a_.col(i);
      index[static_cast<std::size_t>(k++)] = i;
    }
    part.conservativeResize(a_.rows(), k);
    const Eigen::ColPivHouseholderQR<Design> qr(part);
    if (qr.rank() < k) return false;
    const ColumnVector solution = qr.solve(y_);
    z.setZero(a_.cols());
    for (Eigen::Index i = 0; i < k; ++i) z[index[static_cast<std::size_t>(i)]] = solution[i];
    return true;
  }

 private:
  const Design& a_;
  const RowVector& y_;
};

template <typename Solver>
ColumnVector lawson_hanson(const Solver& solver, Eigen::Index columns) {
  ColumnVector x = ColumnVector::Zero(columns);
  ColumnVector z(columns);
  Active active{};
  Active refused{};  // dependent on the active ones, for as long as those do not change
  const double tolerance = solver.tolerance();
  for (int change = 0; change < kMaxChangesPerColumn * static_cast<int>(columns); ++change) {
    const ColumnVector gradient = solver.gradient(x);
    Eigen::Index enter = -1;
    double best = tolerance;
    for (Eigen::Index i = 0; i < columns; ++i) {
      const auto k = static_cast<std::size_t>(i);
      if (active[k] || refused[k] || gradient[i] <= best) continue;
      best = gradient[i];
      enter = i;
    }
    if (enter < 0) break;
    active[static_cast<std::size_t>(enter)] = true;
    if (!solver.solve(active, z) || z[enter] <= 0.0) {
      active[static_cast<std::size_t>(enter)] = false;
      refused[static_cast<std::size_t>(enter)] = true;
      continue;
    }
    refused.fill(false);
    // Step back to the first amplitude that would become negative, drop it, and solve again.
    while (true) {
      double step = 1.0;
      for (Eigen::Index i = 0; i < columns; ++i) {
        if (active[static_cast<std::size_t>(i)] && z[i] <= 0.0) step = std::min(step, x[i] / (x[i] - z[i]));
      }
      if (step >= 1.0) break;
      for (Eigen::Index i = 0; i < columns; ++i) {
        const auto k = static_cast<std::size_t>(i);
        if (!active[k]) continue;
        const bool leaves = z[i] <= 0.0 && x[i] / (x[i] - z[i]) <= step;
        x[i] += step * (z[i] - x[i]);
        if (leaves) {
          x[i] = 0.0;
          active[k] = false;
        }
      }
      if (!solver.solve(active, z)) break;
    }
    x = z;
  }
  return x;
}

}  // namespace

ColumnVector nnls_from_gram(const Gram& gram, const ColumnVector& projected) {
  return lawson_hanson(GramSolver(gram, projected), projected.size());
}

ColumnVector nnls(const Design& a, const RowVector& y) {
  const QrSolver solver(a, y);
  // Where all amplitudes of the unconstrained solution are plainly positive, it is the one.
  constexpr double kPlainly = 1e-9;
  Active all{};
  std::fill_n(all.begin(), a.cols(), true);
  ColumnVector z(a.cols());
  if (a.cols() > 0 && solver.solve(all, z) && z.minCoeff() > kPlainly * z.maxCoeff()) return z;
  return lawson_hanson(solver, a.cols());
}

}  // namespace imuscope::noise
