#include "estimation/batch/pair_moments.h"

#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "base/units.h"

namespace imuscope::batch {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Svd = Eigen::JacobiSVD<Matrix3d>;

Svd svd_of(const Matrix3d& m) { return Svd(m, Eigen::ComputeFullU | Eigen::ComputeFullV); }

double handedness(const Svd& svd) { return (svd.matrixU() * svd.matrixV().transpose()).determinant(); }

/// B-18
Matrix3d rotation_of(const Matrix3d& study_reference) {
  const Svd svd = svd_of(study_reference);
  const Vector3d signs(1.0, 1.0, handedness(svd) < 0.0 ? -1.0 : 1.0);
  return svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
}

/// B-18a: correlation of what the S-IMU shows along u with what the R-IMU shows along v.
double correlation_along(const TriadMoments& m, const Vector3d& u, const Vector3d& v) {
  const double size = std::sqrt(u.dot(m.study * u) * v.dot(m.reference * v));
  return size > 0.0 ? u.dot(m.study_reference * v) / size : 0.0;
}

/// Instants that are averaged before moments are taken: half a second.
constexpr auto kAveraged = static_cast<Eigen::Index>(kGridRate_hz / 2.0);

struct Means {
  Eigen::Matrix<double, 6, 1> reference = Eigen::Matrix<double, 6, 1>::Zero();
  Eigen::Matrix<double, 6, 1> study = Eigen::Matrix<double, 6, 1>::Zero();
  double n = 0.0;  ///< instants at which both are valid
};

bool both_valid(const Grid& reference, const Grid& study, Eigen::Index row) {
  const auto i = static_cast<std::size_t>(row);
  return reference.valid[i] != 0 && study.valid[i] != 0;
}

/// Over the instants [first, end).
Means means_of(const Grid& reference, const Grid& study, Eigen::Index first, Eigen::Index end) {
  Means means;
  for (Eigen::Index i = first; i < end; ++i) {
    if (!both_valid(reference, study, i)) continue;
    means.n += 1.0;
    means.reference += reference.motion.row(i).transpose();
    means.study += study.motion.row(i).transpose();
  }
  if (means.n > 0.0) {
    means.reference /= means.n;
    means.study /= means.n;
  }
  return means;
}

void add(const Vector3d& s, const Vector3d& b, double weight, TriadMoments& moments) {
  moments.study_reference += weight * s * b.transpose();
  moments.study += weight * s * s.transpose();
  moments.reference += weight * b * b.transpose();
}

/// A triad's moments, as if all it shows were of size one.
Matrix3d scaled(const TriadMoments& m) {
  const double size = std::sqrt(m.study.trace() * m.reference.trace());
  return size > 0.0 ? Matrix3d(m.study_reference / size) : Matrix3d::Zero();
}

}  // namespace

double TriadMoments::size_ratio() const { return std::sqrt(study.trace() / reference.trace()); }

Matrix3d TriadMoments::best_rotation() const { return rotation_of(study_reference); }

double TriadMoments::correlation_at(const Matrix3d& C_b_s) const {
  return (C_b_s.transpose() * study_reference).trace() / std::sqrt(study.trace() * reference.trace());
}

double TriadMoments::mirrored() const {
  const Svd svd = svd_of(study_reference);
  if (handedness(svd) > 0.0) return 0.0;
  return correlation_along(*this, svd.matrixU().col(2), svd.matrixV().col(2));
}

double TriadMoments::most_lost(const Matrix3d& C_b_s, double from) const {
  const Svd svd = svd_of(study_reference);
  double most = 0.0;
  for (Eigen::Index i = 0; i < 3; ++i) {
    const Vector3d u = svd.matrixU().col(i);
    const double own = correlation_along(*this, u, svd.matrixV().col(i));
    if (own < from) continue;
    most = std::max(most, own - correlation_along(*this, u, C_b_s.transpose() * u));
  }
  return most;
}

PairMoments::PairMoments(const Grid& reference, const Grid& study) {
  const Eigen::Index rows = reference.motion.rows();
  const Means means = means_of(reference, study, 0, rows);
  mean_force_b_ = means.reference.tail<3>();
  mean_force_s_ = means.study.tail<3>();
  for (Eigen::Index first = 0; first < rows; first += kAveraged) {
    const Means slow = means_of(reference, study, first, std::min(first + kAveraged, rows));
    if (slow.n == 0.0) continue;
    const Eigen::Matrix<double, 6, 1> b = slow.reference - means.reference;
    const Eigen::Matrix<double, 6, 1> s = slow.study - means.study;
    add(s.head<3>(), b.head<3>(), slow.n, rates);
    add(s.tail<3>(), b.tail<3>(), slow.n, forces);
    add(slow.study.tail<3>(), slow.reference.tail<3>(), slow.n, forces_with_gravity);
  }
}

// B-18: rates, forces and mean forces together
Matrix3d PairMoments::common_rotation() const {
  // The mean of a body that is laid on its sides is of no direction.
  const double size = std::min(1.0, mean_force_s_.norm() * mean_force_b_.norm() / (kMps2PerG * kMps2PerG));
  const Matrix3d gravity = size * mean_force_s_.normalized() * mean_force_b_.normalized().transpose();
  return rotation_of(scaled(rates) + scaled(forces) + gravity);
}

double PairMoments::mean_force_gap_mps2(const Matrix3d& C_b_s) const {
  return (mean_force_s_ - C_b_s * mean_force_b_).norm();
}

}  // namespace imuscope::batch
