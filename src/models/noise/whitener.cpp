#include "models/noise/whitener.h"

#include <algorithm>
#include <cmath>

#include "base/contracts.h"

namespace imuscope::noise {
namespace {

/// Variance of an unknown start over the model's own variances: large against them, small enough for double.
constexpr double kDiffuseFactor = 1e7;
/// An innovation whose variance is above this share of the unknown start's belongs to the start.
constexpr double kDiffuseShare = 1e-3;
/// The gain counts as steady when no variance changed by more than this share over a step.
constexpr double kSteadyShare = 1e-14;

}  // namespace

Whitener::Whitener(const Model& model, std::size_t columns)
    : form_(state_space(model)),
      P_(form_.P0),
      states_(Eigen::MatrixXd::Zero(form_.F.rows(), static_cast<Eigen::Index>(columns))),
      gain_(Eigen::VectorXd::Zero(form_.F.rows())),
      innovation_(Eigen::RowVectorXd::Zero(static_cast<Eigen::Index>(columns))) {
  const double scale = form_.R + form_.Q.trace() + form_.P0.trace();
  IMUSCOPE_EXPECTS(columns >= 1 && scale > 0.0);
  diffuse_variance_ = kDiffuseFactor * scale;
  for (std::size_t i = 0; i < form_.diffuse.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    if (form_.diffuse[i]) P_(at, at) += diffuse_variance_;
  }
}

void Whitener::update_gain() {
  const Eigen::VectorXd PHt = P_ * form_.H.transpose();
  const double variance = form_.H.dot(PHt) + form_.R;
  // The next prediction, from the variance after this sample.
  gain_ = PHt / variance;
  Eigen::MatrixXd after = P_ - gain_ * PHt.transpose();
  after = 0.5 * (after + after.transpose()).eval();
  const Eigen::MatrixXd next = form_.F * after * form_.F.transpose() + form_.Q;
  const double change = (next - P_).cwiseAbs().maxCoeff();
  steady_ = change <= kSteadyShare * P_.cwiseAbs().maxCoeff();
  innovation_sd_ = std::sqrt(variance);
  P_ = next;
}

bool Whitener::push(std::span<double> row) {
  IMUSCOPE_EXPECTS(row.size() == static_cast<std::size_t>(innovation_.size()));
  if (form_.F.rows() == 0) {
    const double sd = std::sqrt(form_.R);
    for (double& value : row) value /= sd;
    return true;
  }
  if (!steady_) update_gain();
  Eigen::Map<Eigen::RowVectorXd> values(row.data(), static_cast<Eigen::Index>(row.size()));
  innovation_ = values;
  innovation_.noalias() -= form_.H * states_;
  states_.noalias() += gain_ * innovation_;
  states_ = (form_.F * states_).eval();
  values = innovation_ / innovation_sd_;
  return innovation_sd_ * innovation_sd_ < kDiffuseShare * diffuse_variance_;
}

void Whitener::skip() {
  if (form_.F.rows() == 0) return;
  states_ = (form_.F * states_).eval();
  P_ = form_.F * P_ * form_.F.transpose() + form_.Q;
  steady_ = false;
}

}  // namespace imuscope::noise
