#include "logs/bag/frames.h"

#include <Eigen/Geometry>

#include "sample/eigen_arrays.h"

namespace imuscope::bag {
namespace {

using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

/// Forward-right-down to forward-left-up, and back.
Eigen::Matrix3d half_turn() { return Eigen::Vector3d(1.0, -1.0, -1.0).asDiagonal(); }

mcap::Quaternion quaternion(const Eigen::Matrix3d& rotation) {
  Eigen::Quaterniond q(rotation);
  if (q.w() < 0.0) q.coeffs() = -q.coeffs();
  return {q.x(), q.y(), q.z(), q.w()};
}

}  // namespace

std::string aligned_frame(const std::string& name) { return name + "_aligned"; }

mcap::Quaternion base_link_in_map(const Vector3& rpy_rad) {
  const Eigen::Matrix3d b_to_ned = (Eigen::AngleAxisd(rpy_rad[2], Eigen::Vector3d::UnitZ()) *
                                    Eigen::AngleAxisd(rpy_rad[1], Eigen::Vector3d::UnitY()) *
                                    Eigen::AngleAxisd(rpy_rad[0], Eigen::Vector3d::UnitX()))
                                       .toRotationMatrix();
  Eigen::Matrix3d ned_to_enu;
  ned_to_enu << 0, 1, 0, 1, 0, 0, 0, 0, -1;
  return quaternion(ned_to_enu * b_to_ned * half_turn());
}

mcap::Quaternion sensor_in_base_link(const Rotation& C_b_s) {
  return quaternion(half_turn() * to_eigen(C_b_s).transpose());
}

mcap::Covariance3 covariance_in_base_link(const Rotation& C_b_s, const Vector3& variance_s) {
  const Eigen::Matrix3d turn = half_turn() * to_eigen(C_b_s).transpose();
  const RowMajor covariance = turn * to_eigen(variance_s).asDiagonal() * turn.transpose();
  mcap::Covariance3 out{};
  Eigen::Map<RowMajor>(out.data()) = covariance;
  return out;
}

Vector3 to_base_link(const Rotation& C, const Vector3& v) noexcept {
  return {C[0] * v[0] + C[3] * v[1] + C[6] * v[2], -(C[1] * v[0] + C[4] * v[1] + C[7] * v[2]),
          -(C[2] * v[0] + C[5] * v[1] + C[8] * v[2])};
}

}  // namespace imuscope::bag
