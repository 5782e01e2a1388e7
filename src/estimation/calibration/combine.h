#pragma once

/// Several estimates of one mounting made into one, and the question whether they are of one mounting at all.
/// Non-real-time: allocates. EQUATIONS.md E-20 to E-27.

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "base/result.h"
#include "estimation/calibration/estimator_config.h"

namespace imuscope {

/// Mounting of one S-IMU as one drive found it.
struct MountingEstimate {
  Matrix3 C_b_s{};
  Vector3 r_bs_b_m{};
  /// Of (psi, r), row-major, rad and m; psi in b, C = C^ Exp(-psi). Positive definite.
  std::array<double, 36> covariance_psi_r{};
  /// What of it every drive of this sensor shares: F, row-major, 6 rows; F_i F_j' is the covariance between
  /// the errors of drives i and j. Empty: nothing. Mountings are combined as sharing where all have as many
  /// columns.
  std::vector<double> shared_psi_r{};
};

enum class CombineMethod {
  kInverseVariance,         ///< the drives' errors are independent but for what they are known to share
  kCovarianceIntersection,  ///< they may share errors (one turn-on, one capture cut in two); never
                            ///< over-confident
};

/// How far one drive lies from the others.
struct DriveDeviation {
  /// (psi, r) of the drive minus the least-squares mean of the others, rad and m; by the sd of the
  /// difference, with what mountings do between drives in it.
  std::array<double, 6> deviation{};
  std::array<double, 6> deviation_sd{};
  /// Chance that a drive lies as far from the others as this one does, where all scatter alike (E-27).
  double p_value = 1.0;
};

/// The one mounting made of all estimates, and how well they agree on it.
struct CombinedMounting {
  MountingEstimate estimate;
  std::vector<DriveDeviation> drives;  ///< in the order given; of a single drive all zero
  std::vector<double> weights;         ///< per drive; covariance intersection only, else 1 each
  /// Sum of squared deviations from the least-squares mean, by the covariance of all drives. Chi-square with
  /// 6 (n - 1) degrees of freedom where the mounting repeats exactly from drive to drive.
  double homogeneity_chi2 = 0.0;
  std::size_t homogeneity_dof = 0;
  double homogeneity_p_value = 1.0;
  /// What the mounting does between drives beyond the drives' own sd, sd of each axis (E-25). Zero by
  /// covariance intersection, which knows nothing of it.
  double between_drives_psi_sd_rad = 0.0;
  double between_drives_r_sd_m = 0.0;

  /// Chance that a drive lies as far from the others as the farthest does (Bonferroni's bound): below a level
  /// it was taken off or struck, and is no drive of this mounting.
  [[nodiscard]] double one_mounting_p_value() const;
};

/// Fails where there is no estimate, or a covariance is not positive definite (the message names which, from
/// 1).
[[nodiscard]] Result<CombinedMounting> combine(std::span<const MountingEstimate> estimates,
                                               CombineMethod method);

/// The paper's final value: mean of the values over time, weighted by their inverse variances. Shown beside
/// the filter's end value for comparison: its sd takes correlated values for independent ones and is too
/// small.
class WeightedMean {
 public:
  /// Precondition: sd > 0.
  void add(double value, double sd) noexcept;
  [[nodiscard]] double mean() const noexcept { return weight_ > 0.0 ? sum_ / weight_ : 0.0; }
  [[nodiscard]] double claimed_sd() const noexcept;

 private:
  double sum_ = 0.0;
  double weight_ = 0.0;
};

}  // namespace imuscope
