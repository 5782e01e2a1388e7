#pragma once

/// What was found of a mounting against what is known of it.

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

namespace imuscope::test {

inline Eigen::Matrix3d matrix_of(const nlohmann::json& row_major) {
  Eigen::Matrix3d m;
  for (int i = 0; i < 9; ++i) m(i / 3, i % 3) = row_major.at(static_cast<std::size_t>(i)).get<double>();
  return m;
}

inline Eigen::Vector3d vector_of(const nlohmann::json& values) {
  return {values.at(0).get<double>(), values.at(1).get<double>(), values.at(2).get<double>()};
}

/// Rotation vector in b from the known C_b_s to the found one, rad.
inline Eigen::Vector3d rotation_between_b(const Eigen::Matrix3d& known_C_b_s,
                                          const Eigen::Matrix3d& found_C_b_s) {
  const Eigen::AngleAxisd difference(Eigen::Matrix3d(known_C_b_s.transpose() * found_C_b_s));
  return difference.angle() * difference.axis();
}

/// Rotation of intrinsic zyx Euler angles, degrees: Rz(z) Ry(y) Rx(x).
inline Eigen::Matrix3d from_zyx_deg(double x, double y, double z) {
  constexpr double kRad = 3.14159265358979323846 / 180.0;
  return (Eigen::AngleAxisd(z * kRad, Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(y * kRad, Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(x * kRad, Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

}  // namespace imuscope::test
