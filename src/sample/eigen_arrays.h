#pragma once

/// The samples' vectors and matrices (row-major arrays) as Eigen's, and back. Any thread.

#include <Eigen/Core>
#include <array>

#include "sample/sample.h"

namespace imuscope {

inline Eigen::Vector3d to_eigen(const Vector3& v) noexcept { return {v[0], v[1], v[2]}; }

inline Eigen::Matrix3d to_eigen(const std::array<double, 9>& m) noexcept {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(m.data());
}
/// Of a vector a Vector3, of a matrix of 3 x 3 its nine elements row by row.
template <typename Derived>
auto to_array(const Eigen::MatrixBase<Derived>& m) noexcept {
  constexpr int kColumns = Derived::ColsAtCompileTime;
  static_assert(Derived::RowsAtCompileTime == 3 && (kColumns == 1 || kColumns == 3));
  std::array<double, static_cast<std::size_t>(3 * kColumns)> out;
  Eigen::Map<Eigen::Matrix<double, 3, kColumns, kColumns == 1 ? Eigen::ColMajor : Eigen::RowMajor>>(
      out.data()) = m;
  return out;
}

}  // namespace imuscope
