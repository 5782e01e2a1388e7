#include "models/dynamics/column_wavelets.h"

#include <algorithm>

#include "base/contracts.h"
#include "models/noise/haar_levels.h"

namespace imuscope {

using Eigen::Index;
using Eigen::MatrixXd;

ColumnWavelets::ColumnWavelets(std::size_t columns)
    : columns_(columns), sum_(Eigen::VectorXd::Zero(static_cast<Index>(columns))) {
  IMUSCOPE_EXPECTS(columns >= 1);
}

void ColumnWavelets::add(std::span<const double> row) {
  IMUSCOPE_EXPECTS(row.size() == columns_);
  sum_ += Eigen::Map<const Eigen::VectorXd>(row.data(), static_cast<Index>(columns_));
  count();
}

void ColumnWavelets::skip() {
  ++missing_in_block_;
  count();
}

void ColumnWavelets::count() {
  if (++in_block_ < kBlock) return;
  sums_.insert(sums_.end(), sum_.begin(), sum_.end());
  missing_.push_back(missing_in_block_);
  sum_.setZero();
  in_block_ = 0;
  missing_in_block_ = 0;
}

std::vector<ColumnLevel> ColumnWavelets::levels() const {
  const auto blocks = static_cast<Index>(missing_.size());
  const auto columns = static_cast<Index>(columns_);
  // Sums up to each block, and the rows that were missing up to there.
  MatrixXd sums = MatrixXd::Zero(columns, blocks + 1);
  std::vector<std::size_t> missing(missing_.size() + 1, 0);
  for (Index i = 0; i < blocks; ++i) {
    const auto at = static_cast<std::size_t>(i);
    sums.col(i + 1) = sums.col(i) + Eigen::Map<const Eigen::VectorXd>(sums_.data() + at * columns_, columns);
    missing[at + 1] = missing[at] + missing_[at];
  }
  const auto missing_between = [&](Index from, Index to) {
    return missing[static_cast<std::size_t>(to)] - missing[static_cast<std::size_t>(from)];
  };
  // Neighbouring coefficients tell the same: a quarter of a half-length from one to the next.
  constexpr Index kStepsPerHalf = 4;
  std::vector<ColumnLevel> out;
  int level = kBlockLevel + 1;
  for (Index half = 1; 2 * half <= blocks; half *= 2, ++level) {
    const auto rows = static_cast<std::size_t>(half) * kBlock;
    MatrixXd coefficients(columns, blocks / std::max<Index>(half / kStepsPerHalf, 1) + 1);
    Index n = 0;
    for (Index i = 0; i + 2 * half <= blocks; i += std::max<Index>(half / kStepsPerHalf, 1)) {
      const std::size_t older = missing_between(i, i + half);
      const std::size_t newer = missing_between(i + half, i + 2 * half);
      if (rows - older < noise::least_valid(rows) || rows - newer < noise::least_valid(rows)) continue;
      coefficients.col(n++) =
          0.5 * ((sums.col(i + 2 * half) - sums.col(i + half)) / static_cast<double>(rows - newer) -
                 (sums.col(i + half) - sums.col(i)) / static_cast<double>(rows - older));
    }
    if (n == 0) break;
    const auto used = coefficients.leftCols(n);
    // D-7: G_j
    out.push_back({level, used * used.transpose() / static_cast<double>(n)});
  }
  return out;
}

}  // namespace imuscope
