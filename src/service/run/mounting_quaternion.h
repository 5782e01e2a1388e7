#pragma once

/// A mounting's rotation as files and messages have it. Any thread.

#include <Eigen/Geometry>

#include "sample/eigen_arrays.h"

namespace imuscope {

/// Hamilton quaternion of C_b_s, scalar part not negative: the matrix's own numbers, not normalised again.
inline Eigen::Quaterniond mounting_quaternion(const std::array<double, 9>& C_b_s) noexcept {
  Eigen::Quaterniond q(to_eigen(C_b_s));
  if (q.w() < 0.0) q.coeffs() = -q.coeffs();
  return q;
}

}  // namespace imuscope
