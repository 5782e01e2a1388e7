#include "dynamics/column_wavelets.h"

#include <algorithm>

#include "base/contracts.h"

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
  whole_ = false;
  count();
}

void ColumnWavelets::count() {
  if (++in_block_ < kBlock) return;
  for (const double value : sum_) means_.push_back(value / static_cast<double>(kBlock));
  valid_.push_back(whole_ ? 1 : 0);
  sum_.setZero();
  in_block_ = 0;
  whole_ = true;
}

std::vector<ColumnLevel> ColumnWavelets::levels() const {
  const auto blocks = static_cast<Index>(valid_.size());
  const auto columns = static_cast<Index>(columns_);
  // Sums up to each block, and the number of blocks with something missing.
  MatrixXd sums = MatrixXd::Zero(columns, blocks + 1);
  std::vector<Index> missing(valid_.size() + 1, 0);
  for (Index i = 0; i < blocks; ++i) {
    const auto at = static_cast<std::size_t>(i);
    sums.col(i + 1) = sums.col(i) + Eigen::Map<const Eigen::VectorXd>(means_.data() + at * columns_, columns);
    missing[at + 1] = missing[at] + (valid_[at] == 0 ? 1 : 0);
  }
  // Neighbouring coefficients tell the same: a quarter of a half-length from one to the next.
  constexpr Index kStepsPerHalf = 4;
  std::vector<ColumnLevel> out;
  int level = kBlockLevel + 1;
  for (Index half = 1; 2 * half <= blocks; half *= 2, ++level) {
    MatrixXd coefficients(columns, blocks / std::max<Index>(half / kStepsPerHalf, 1) + 1);
    Index n = 0;
    for (Index i = 0; i + 2 * half <= blocks; i += std::max<Index>(half / kStepsPerHalf, 1)) {
      if (missing[static_cast<std::size_t>(i + 2 * half)] != missing[static_cast<std::size_t>(i)]) continue;
      coefficients.col(n++) = (sums.col(i + 2 * half) - 2.0 * sums.col(i + half) + sums.col(i)) /
                              (2.0 * static_cast<double>(half));
    }
    if (n == 0) break;
    const auto used = coefficients.leftCols(n);
    out.push_back({level, used * used.transpose() / static_cast<double>(n)});
  }
  return out;
}

}  // namespace imuscope
