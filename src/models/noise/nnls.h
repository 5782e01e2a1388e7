#pragma once

/// Non-negative least squares for the few columns of a noise model (Lawson and Hanson 1974, ch. 23).

#include <Eigen/Core>

namespace imuscope::noise {

/// Most columns of a model, and most levels, so that the solver never needs the heap.
inline constexpr int kMaxColumns = 16;
inline constexpr int kMaxRows = 32;

using ColumnVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxColumns, 1>;
using RowVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxRows, 1>;
using Design = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxRows, kMaxColumns>;
using Gram = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxColumns, kMaxColumns>;

/// argmin |A x - y| with x >= 0, from A'A and A'y. Fast, and as accurate as the square of A's condition
/// allows: for searching. The columns of A have length 1.
ColumnVector nnls_from_gram(const Gram& gram, const ColumnVector& projected);

/// argmin |A x - y| with x >= 0, from A itself: for the final answer. Zeros are exact.
ColumnVector nnls(const Design& a, const RowVector& y);

}  // namespace imuscope::noise
