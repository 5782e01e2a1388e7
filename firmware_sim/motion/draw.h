#pragma once

/// Random vectors, and the rotations they stand for.

#include <Eigen/Geometry>

#include "firmware_sim/random/random.h"

namespace imusim {

/// Three normal draws.
inline Eigen::Vector3d draw3(Random& random, double sd) {
  const double x = random.normal();
  const double y = random.normal();
  const double z = random.normal();
  return sd * Eigen::Vector3d(x, y, z);
}

/// Exp of a rotation vector, rad.
inline Eigen::Matrix3d rotation_from_vector(const Eigen::Vector3d& vector) {
  const double angle = vector.norm();
  if (angle == 0.0) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, vector / angle).toRotationMatrix();
}

}  // namespace imusim
