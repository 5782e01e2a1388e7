#pragma once

/// Haar wavelet variances and covariances of the columns of a regression, scale by scale: where in the
/// spectrum the columns carry information. Coarse scales only, from means of blocks of samples: at the
/// finer ones a few columns are nothing beside the number of samples (D-7, D-8 in EQUATIONS.md). Missing rows
/// cost what missing samples cost the wavelet variance of the errors (models/noise/haar_levels.h).

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

namespace imuscope {

/// One scale: mean of W_j W_j' over all columns.
struct ColumnLevel {
  int level = 0;  ///< j, as of the samples
  Eigen::MatrixXd products;
};

/// Thread: owner. Memory: one double a column and block.
class ColumnWavelets {
 public:
  /// Samples of a block are 2^kBlockLevel; the first scale is the next one.
  static constexpr int kBlockLevel = 4;

  explicit ColumnWavelets(std::size_t columns);
  /// One row of the columns, all finite.
  void add(std::span<const double> row);
  /// A row that is missing.
  void skip();

  /// Scales that have at least one coefficient.
  [[nodiscard]] std::vector<ColumnLevel> levels() const;

 private:
  static constexpr std::size_t kBlock = std::size_t{1} << static_cast<unsigned>(kBlockLevel);
  void count();

  std::size_t columns_;
  Eigen::VectorXd sum_;
  std::size_t in_block_ = 0;
  std::size_t missing_in_block_ = 0;
  std::vector<double> sums_;  ///< block by block
  std::vector<std::size_t> missing_;
};

}  // namespace imuscope
