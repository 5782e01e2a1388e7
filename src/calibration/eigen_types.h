#pragma once

/// The samples' and the interfaces' vectors and matrices (row-major arrays) as Eigen's, and back.

#include <Eigen/Core>

#include "calibration/estimator_config.h"
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

}  // namespace imuscope
