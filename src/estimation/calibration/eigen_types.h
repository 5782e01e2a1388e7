#pragma once

/// The samples' and the interfaces' vectors and matrices (row-major arrays) as Eigen's, and back.

#include <Eigen/Core>
#include <algorithm>

#include "estimation/calibration/covariance_kernel.h"
#include "estimation/calibration/estimator_config.h"
#include "sample/sample.h"

namespace imuscope {

inline Eigen::Vector3d to_eigen(const Vector3& v) noexcept { return {v[0], v[1], v[2]}; }
inline Vector3 to_array(const Eigen::Vector3d& v) noexcept { return {v.x(), v.y(), v.z()}; }

inline Eigen::Matrix3d to_eigen(const Matrix3& m) noexcept {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(m.data());
}
inline Matrix3 to_array(const Eigen::Matrix3d& m) noexcept {
  Matrix3 out;
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(out.data()) = m;
  return out;
}

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
