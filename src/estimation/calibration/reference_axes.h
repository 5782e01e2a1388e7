#pragma once

/// What the errors of the reference's own axes make of a mounting that is found with them. No state holds them: they look
/// like scales, axes and triads of the S-IMU, as far as the filter lets these go from their priors, and else like a
/// mounting. EQUATIONS.md C-27. Core.

#include <Eigen/Core>

#include "estimation/navigation/reference_grade.h"

namespace imuscope {

/// Places of states of one S-IMU, three each.
namespace affected {
inline constexpr Eigen::Index kPsi = 0;
inline constexpr Eigen::Index kR = 3;
// What the errors look like:
inline constexpr Eigen::Index kGyroScale = 6;
inline constexpr Eigen::Index kGyroAxes = 9;
inline constexpr Eigen::Index kAccelScale = 12;
inline constexpr Eigen::Index kAccelAxes = 15;
inline constexpr Eigen::Index kAccelBoresight = 18;
inline constexpr Eigen::Index kSize = 21;
}  // namespace affected

inline constexpr Eigen::Index kTakenUp = affected::kSize - affected::kGyroScale;
/// Of gyros and accelerometers: scale of each axis, lean of each pair; the rotation between the triads.
inline constexpr Eigen::Index kAxesErrors = 15;

using AffectedCovariance = Eigen::Matrix<double, affected::kSize, affected::kSize>;
using TakenUpSd = Eigen::Matrix<double, kTakenUp, 1>;
using ReferenceColumns = Eigen::Matrix<double, affected::kSize, kAxesErrors>;

/// The error of each state by each error of the reference's axes, off by its sd.
/// @param P         as the filter has it; zero where a state is absent
/// @param prior_sd  of the states from kGyroScale on; zero where a state is absent
[[nodiscard]] ReferenceColumns reference_columns(const AffectedCovariance& P, const TakenUpSd& prior_sd,
                                                 const Eigen::Matrix3d& C_b_s,
                                                 const ReferenceGrade& grade) noexcept;

/// Variance, m^2, of the lever arm itself, in b, which is as much too short as the reference's readings are too large.
[[nodiscard]] Eigen::Vector3d r_by_scale_m2(const Eigen::Vector3d& r_bs_b_m,
                                            const ReferenceGrade& grade) noexcept;

}  // namespace imuscope
