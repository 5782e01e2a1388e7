#include "estimation/alignment/coarse_mounting.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "base/units.h"

namespace imuscope {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr int kReweightings = 5;
/// Below this correlation of the rates no rotation explains them, given that they were excited at all.
constexpr double kCorrelationMin = 0.5;
/// A mirrored triad shows when a mirror leaves less than this share of what the best rotation leaves.
constexpr double kMirrorResidualShare = 0.5;
/// Mean forces that differ by more than this many accelerometer bias sd are not of one gravity.
constexpr double kGravityMismatchSds = 5.0;
/// Pairs that enter as one mean: 0.12 s at 100 Hz, above the periods of vibration, below those of driving.
constexpr int kPairsPerObservation = 12;
/// What the rotation leaves unexplained (lever arm, flexing) stays alike over some half a second of road: so
/// many observations tell as much as one.
constexpr double kAlikeObservations = 5.0;

/// the orthogonal matrix of the given determinant (+1 or -1) that maximises trace(C B'), by SVD.
Matrix3d best_orthogonal(const Matrix3d& B, double determinant) noexcept {
  const Eigen::JacobiSVD<Matrix3d> svd(B, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double sign = determinant * svd.matrixU().determinant() * svd.matrixV().determinant();
  return svd.matrixU() * Vector3d(1.0, 1.0, sign).asDiagonal() * svd.matrixV().transpose();
}

/// sum |s - C b|^2 from the second moments.
double residual_sum(const Matrix3d& bb, const Matrix3d& sb, const Matrix3d& ss, const Matrix3d& C) noexcept {
  return std::max(0.0, ss.trace() + bb.trace() - 2.0 * (C * sb.transpose()).trace());
}

/// Information on a rotation from sum b b': sum [b x]'[b x].
Matrix3d rotation_information(const Matrix3d& bb) noexcept { return bb.trace() * Matrix3d::Identity() - bb; }

}  // namespace

// running means and second moments
void CoarseMountingEstimator::Moments::add(const Vector3d& b, const Vector3d& s, double n) noexcept {
  const Vector3d db = b - mean_b;
  const Vector3d ds = s - mean_s;
  mean_b += db / n;
  mean_s += ds / n;
  const double weight = (n - 1.0) / n;
  bb.noalias() += weight * db * db.transpose();
  sb.noalias() += weight * ds * db.transpose();
  ss.noalias() += weight * ds * ds.transpose();
}

void CoarseMountingEstimator::add(const Vector3d& omega_b_radps, const Vector3d& f_b_mps2,
                                  const Vector3d& omega_s_radps, const Vector3d& f_s_mps2) noexcept {
  if (!omega_b_radps.allFinite() || !f_b_mps2.allFinite() || !omega_s_radps.allFinite() ||
      !f_s_mps2.allFinite()) {
    return;
  }
  ++pairs_;
  waiting_.omega_b += omega_b_radps;
  waiting_.f_b += f_b_mps2;
  waiting_.omega_s += omega_s_radps;
  waiting_.f_s += f_s_mps2;
  if (++waiting_.count < kPairsPerObservation) return;
  // the mean of some pairs as one observation
  constexpr double kShare = 1.0 / kPairsPerObservation;
  ++observations_;
  const auto n = static_cast<double>(observations_);
  rate_.add(kShare * waiting_.omega_b, kShare * waiting_.omega_s, n);
  force_.add(kShare * waiting_.f_b, kShare * waiting_.f_s, n);
  waiting_ = Sums{};
}

void CoarseMountingEstimator::clear() noexcept {
  rate_ = Moments{};
  force_ = Moments{};
  waiting_ = Sums{};
  observations_ = 0;
  pairs_ = 0;
}

MountingResult CoarseMountingEstimator::solve(CoarseMounting& out) const noexcept {
  if (pairs_ < options_.pairs_min) return MountingResult::kTooFewPairs;
  const auto n = static_cast<double>(observations_);
  // What turns the mean force: the accelerometer's bias, and the mean centripetal force over a lever arm.
  const double mean_square_rate = rate_.bb.trace() / n + rate_.mean_b.squaredNorm();
  const double gravity_sd = std::hypot(options_.accel_bias_sd_mps2, options_.arm_m * mean_square_rate);
  const double gravity_weight = 1.0 / (gravity_sd * gravity_sd);
  const Matrix3d gravity_bb = force_.mean_b * force_.mean_b.transpose();
  const Matrix3d gravity_sb = force_.mean_s * force_.mean_b.transpose();

  // weights from the residuals that the last rotation leaves. At first each family weighs by its own
  // size, as if it explained nothing.
  const auto observation_weight = [&](double sum_of_squares) {
    return 1.0 / (kAlikeObservations * sum_of_squares / (3.0 * n) + 1e-18);
  };
  double rate_weight = observation_weight(rate_.ss.trace());
  double force_weight = observation_weight(force_.ss.trace());
  Matrix3d B;
  Matrix3d C;
  for (int i = 0; i < kReweightings; ++i) {
    B = rate_weight * rate_.sb + force_weight * force_.sb + gravity_weight * gravity_sb;
    C = best_orthogonal(B, 1.0);
    rate_weight = observation_weight(residual_sum(rate_.bb, rate_.sb, rate_.ss, C));
    force_weight = observation_weight(residual_sum(force_.bb, force_.sb, force_.ss, C));
  }
  const double power = std::sqrt(rate_.bb.trace() * rate_.ss.trace());
  const double correlation = power > 0.0 ? (C * rate_.sb.transpose()).trace() / power : 0.0;
  out.rate_correlation = correlation;
  if (is_mirrored(B, C)) return MountingResult::kInconsistent;

  //
  const Matrix3d information = rate_weight * rotation_information(rate_.bb) +
                               force_weight * rotation_information(force_.bb) +
                               gravity_weight * rotation_information(gravity_bb);
  // Where there is no information at all, half a turn is what is known anyway.
  const Matrix3d known_anyway = Matrix3d::Identity() / (kPi * kPi);
  const Matrix3d covariance = (information + known_anyway).inverse();
  out.C_b_s = C;
  out.covariance_rad2 = covariance;
  out.gyro_bias_s_radps = rate_.mean_s - C * rate_.mean_b;

  const Eigen::SelfAdjointEigenSolver<Matrix3d> eigen(covariance, Eigen::EigenvaluesOnly);
  //
  if (std::sqrt(eigen.eigenvalues()(2)) > options_.sd_limit_rad) return MountingResult::kTooLittleExcitation;
  // rates that are not alike, or mean forces of two gravities
  const double gravity_mismatch = (force_.mean_s - C * force_.mean_b).norm();
  if (correlation < kCorrelationMin || gravity_mismatch > kGravityMismatchSds * gravity_sd) {
    return MountingResult::kInconsistent;
  }
  return MountingResult::kOk;
}

// a mirror
bool CoarseMountingEstimator::is_mirrored(const Matrix3d& B, const Matrix3d& C) const noexcept {
  const Matrix3d mirror = best_orthogonal(B, -1.0);
  return residual_sum(rate_.bb, rate_.sb, rate_.ss, mirror) <
             kMirrorResidualShare * residual_sum(rate_.bb, rate_.sb, rate_.ss, C) &&
         (mirror * force_.mean_b - force_.mean_s).norm() <= (C * force_.mean_b - force_.mean_s).norm();
}

}  // namespace imuscope
