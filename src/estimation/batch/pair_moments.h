#pragma once

/// What the second moments of two IMUs on one body say about the rotation between them, triad by triad:
/// whether there is one, which, and whether both triads mean the same. B-18 and B-18a in EQUATIONS.md.

#include <Eigen/Core>

#include "estimation/batch/grid.h"

namespace imuscope::batch {

/// Moments of one triad of the S-IMU (axes s) and of the R-IMU (axes b).
struct TriadMoments {
  Eigen::Matrix3d study_reference = Eigen::Matrix3d::Zero();  ///< sum z_s z_b'
  Eigen::Matrix3d study = Eigen::Matrix3d::Zero();            ///< sum z_s z_s'
  Eigen::Matrix3d reference = Eigen::Matrix3d::Zero();        ///< sum z_b z_b'

  /// Size of what the S-IMU shows over that of the R-IMU.
  [[nodiscard]] double size_ratio() const;
  /// The rotation C_b_s that fits best (Kabsch).
  [[nodiscard]] Eigen::Matrix3d best_rotation() const;
  /// Correlation over all three axes at a rotation, -1 to 1.
  [[nodiscard]] double correlation_at(const Eigen::Matrix3d& C_b_s) const;
  /// Correlation along the direction that only a reflection brings together; zero where a rotation does.
  [[nodiscard]] double mirrored() const;
  /// Over the principal directions in which a rotation or reflection of the triad's own reaches a correlation
  /// of `from`: the most that is lost of it at C_b_s.
  [[nodiscard]] double most_lost(const Eigen::Matrix3d& C_b_s, double from) const;
};

/// Moments of both triads over the instants at which both IMUs are valid, of what is slow: means over half a
/// second. Forces of a body that shakes differ from place to place by its angular acceleration.
class PairMoments {
 public:
  PairMoments(const Grid& reference, const Grid& study);

  /// One rotation for rates, forces about their means, and mean forces, each with the same weight; the last with less
  /// where they are smaller than gravity, as the body lay now this way, now that.
  [[nodiscard]] Eigen::Matrix3d common_rotation() const;
  /// How far the mean forces are apart at a rotation.
  [[nodiscard]] double mean_force_gap_mps2(const Eigen::Matrix3d& C_b_s) const;

  TriadMoments rates;                ///< about their means
  TriadMoments forces;               ///< about their means
  TriadMoments forces_with_gravity;  ///< about zero

 private:
  Eigen::Vector3d mean_force_s_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_force_b_ = Eigen::Vector3d::Zero();
};

}  // namespace imuscope::batch
