#pragma once

/// By how much a mounting differs from drive to drive beyond what each drive's own sd says: a bracket gives
/// way, a plate is screwed on anew, axes move with temperature. Each drive sees its own mounting, and its
/// parts agree on that one; only several drives tell. E-25 to E-27 in EQUATIONS.md. Non-real-time: allocates.

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace imuscope {

/// What several drives say of one mounting, with all that it may do between them weighed.
struct DriveScatter {
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  using Matrix6 = Eigen::Matrix<double, 6, 6>;

  Vector6 mean = Vector6::Zero();
  Matrix6 covariance = Matrix6::Zero();  ///< of the mean
  /// sd from drive to drive, root mean square over what is likely: of each component of psi, of r.
  double psi_sd_rad = 0.0;
  double r_sd_m = 0.0;
  /// Each drive against the mean of the others.
  struct Drive {
    Vector6 deviation = Vector6::Zero();
    Vector6 sd = Vector6::Zero();
    double p_value = 1.0;  ///< of a deviation as large, where the drive is one like the others
  };
  std::vector<Drive> drives;
};

/// @param x           (psi, r) of the drives one after the other, about one of them
/// @param covariance  of x, positive definite
/// Precondition: two drives at least.
[[nodiscard]] DriveScatter drive_scatter(const Eigen::VectorXd& x, const Eigen::MatrixXd& covariance);

}  // namespace imuscope
