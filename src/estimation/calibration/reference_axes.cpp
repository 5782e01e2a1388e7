#include "estimation/calibration/reference_axes.h"

namespace imuscope {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Gyros and accelerometers each take the arm for longer or shorter by a scale of their own.
constexpr double kTriads = 2.0;

constexpr Index taken_up(Index state) { return state - affected::kGyroScale; }

/// A column for each error, off by its sd: what it is as an error of the S-IMU's, in s. C-27.
Eigen::Matrix<double, kTakenUp, kAxesErrors> as_errors_of_s(const Matrix3d& C_b_s,
                                                            const ReferenceGrade& grade) {
  Eigen::Matrix<double, kTakenUp, kAxesErrors> out = Eigen::Matrix<double, kTakenUp, kAxesErrors>::Zero();
  Index column = 0;
  for (Index i = 0; i < 3; ++i) {
    for (Index j = i; j < 3; ++j) {
      Matrix3d E_b = Matrix3d::Zero();
      E_b(i, j) = E_b(j, i) = i == j ? grade.scale_sd : grade.lean_sd_rad;
      const Matrix3d E_s = C_b_s * E_b * C_b_s.transpose();
      for (const Index triad : {affected::kGyroScale, affected::kAccelScale}) {
        out.col(column).segment<3>(taken_up(triad)) = E_s.diagonal();
        out.col(column).segment<3>(taken_up(triad) + 3) = Vector3d(E_s(1, 2), E_s(0, 2), E_s(0, 1));
        ++column;
      }
    }
    // As likely about any axis: the same in b and in s.
    out(taken_up(affected::kAccelBoresight) + i, column++) = grade.triad_sd_rad;
  }
  return out;
}

}  // namespace

// C-27
ReferenceColumns reference_columns(const AffectedCovariance& P, const TakenUpSd& prior_sd,
                                   const Matrix3d& C_b_s, const ReferenceGrade& grade) noexcept {
  const Eigen::Matrix<double, kTakenUp, kAxesErrors> errors = as_errors_of_s(C_b_s, grade);
  Eigen::Matrix<double, affected::kSize, kTakenUp> kept = P.rightCols<kTakenUp>();
  for (Index i = 0; i < kTakenUp; ++i) {
    if (!(prior_sd(i) > 0.0)) continue;
    kept.col(i) /= prior_sd(i) * prior_sd(i);
    kept(affected::kGyroScale + i, i) -= 1.0;
  }
  return kept * errors;
}

// C-27
Vector3d r_by_scale_m2(const Vector3d& r_bs_b_m, const ReferenceGrade& grade) noexcept {
  return kTriads * (grade.scale_sd * r_bs_b_m).cwiseAbs2();
}

}  // namespace imuscope
