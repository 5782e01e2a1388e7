#include "calibration/smoother.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace imuscope {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

VectorXd vector_of(std::span<const double> values) {
  return Eigen::Map<const VectorXd>(values.data(), static_cast<Index>(values.size()));
}

MatrixXd unpacked(const std::vector<double>& packed, Index n) {
  MatrixXd P(n, n);
  std::size_t next = 0;
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j <= i; ++j) {
      P(i, j) = P(j, i) = packed[next++];
    }
  }
  return P;
}

/// Solves X A = B for symmetric, positive semi-definite A, scaled to unit diagonal first: states differ by
/// ten orders of magnitude, and those without uncertainty stay without.
MatrixXd solve_right(const MatrixXd& A, const MatrixXd& B) {
  VectorXd scale(A.rows());
  for (Index i = 0; i < A.rows(); ++i) scale(i) = A(i, i) > 0.0 ? 1.0 / std::sqrt(A(i, i)) : 0.0;
  MatrixXd scaled = scale.asDiagonal() * A * scale.asDiagonal();
  for (Index i = 0; i < A.rows(); ++i) {
    if (scale(i) == 0.0) scaled(i, i) = 1.0;
  }
  const MatrixXd right = scale.asDiagonal() * B.transpose();
  const MatrixXd solved = scaled.ldlt().solve(right);
  return (scale.asDiagonal() * solved).transpose();
}

}  // namespace

void Smoother::on_history(const HistoryEpoch& epoch) noexcept {
  const FilterCore& core = epoch.core;
  if (layouts_.empty()) {
    for (std::size_t i = 0; i < core.study_count(); ++i) layouts_.push_back(core.layout(i));
  }
  Stored stored;
  stored.time = epoch.time;
  stored.connected = epoch.connected;
  stored.navigation = core.navigation();
  for (std::size_t i = 0; i < core.study_count(); ++i)
    stored.studies.push_back({core.study(i).gyro_bias_s_radps, core.study(i).accel_bias_s_mps2});
  const std::size_t n = core.covariance().dimension();
  stored.covariance.reserve(n * (n + 1) / 2);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j <= i; ++j) stored.covariance.push_back(core.covariance()(i, j));
  }
  stored.transition = epoch.navigation_transition;
  stored.noise = epoch.navigation_noise;
  stored.decay = vector_of(epoch.decay);
  stored.decay_noise = vector_of(epoch.noise);
  stored.injected = vector_of(epoch.injected);
  epochs_.push_back(std::move(stored));
}

std::size_t Smoother::memory_bytes() const noexcept {
  std::size_t bytes = 0;
  for (const Stored& stored : epochs_) {
    bytes += sizeof(Stored) + stored.covariance.size() * sizeof(double) +
             3 * static_cast<std::size_t>(stored.injected.size()) * sizeof(double) +
             stored.studies.size() * sizeof(SmoothedEpoch::Biases);
  }
  return bytes;
}

std::vector<SmoothedEpoch> Smoother::smooth() const {
  std::vector<SmoothedEpoch> out(epochs_.size());
  MatrixXd P_next;  // smoothed, of the epoch after
  VectorXd d_next;  // truth minus filtered estimate, as far as known, of the epoch after
  for (std::size_t back = 0; back < epochs_.size(); ++back) {
    const std::size_t k = epochs_.size() - 1 - back;
    const Stored& now = epochs_[k];
    const auto n = static_cast<Index>(now.injected.size());
    MatrixXd P = unpacked(now.covariance, n);
    VectorXd d = VectorXd::Zero(n);
    if (back > 0 && epochs_[k + 1].connected) {
      const Stored& after = epochs_[k + 1];
      MatrixXd Phi = MatrixXd::Identity(n, n);
      Phi.topLeftCorner<15, 15>() = after.transition;
      Phi.diagonal().tail(n - 15) = after.decay;
      MatrixXd predicted = Phi * P * Phi.transpose();
      predicted.topLeftCorner<15, 15>() += after.noise;
      predicted.diagonal().tail(n - 15) += after.decay_noise;
      // E-12: A = P Phi^T P_predicted^-1; the predicted covariance, not the filtered one of the epoch after.
      const MatrixXd A = solve_right(predicted, P * Phi.transpose());
      d = A * (d_next + after.injected);
      P += A * (P_next - predicted) * A.transpose();
    }
    SmoothedEpoch& smoothed = out[k];
    smoothed.time = now.time;
    smoothed.navigation = now.navigation;
    inject(smoothed.navigation, NavigationErrorVector(d.head<15>()));
    smoothed.studies = now.studies;
    for (std::size_t i = 0; i < layouts_.size(); ++i) {
      const StudyLayout& layout = layouts_[i];
      if (layout.gyro_bias != StudyLayout::kAbsent)
        smoothed.studies[i].gyro_radps += d.segment<3>(static_cast<Index>(layout.gyro_bias));
      if (layout.accel_bias != StudyLayout::kAbsent)
        smoothed.studies[i].accel_mps2 += d.segment<3>(static_cast<Index>(layout.accel_bias));
    }
    smoothed.sd = P.diagonal().cwiseMax(0.0).cwiseSqrt();
    P_next = std::move(P);
    d_next = std::move(d);
  }
  return out;
}

}  // namespace imuscope
