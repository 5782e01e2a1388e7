#pragma once

/// Columns of a measurement from Eigen's matrices.

#include <Eigen/Core>
#include <algorithm>

#include "estimation/calibration/covariance_kernel.h"

namespace imuscope {

/// Columns of a measurement, in blocks of three and what is left.
template <typename Matrix>
void append_columns(const Matrix& H, std::size_t first, SparseMeasurement& out) noexcept {
  constexpr std::size_t kColumns = Matrix::ColsAtCompileTime;
  for (std::size_t column = 0; column < kColumns; column += 3) {
    const std::size_t width = std::min<std::size_t>(3, kColumns - column);
    MeasurementBlock& block = out.append(first + column, width);
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < width; ++j)
        block.h[i][j] = H(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(column + j));
    }
  }
}

}  // namespace imuscope
