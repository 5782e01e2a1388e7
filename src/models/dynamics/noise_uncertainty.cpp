#include "models/dynamics/noise_uncertainty.h"

#include <Eigen/Cholesky>

#include "models/noise/inference.h"
#include "models/noise/model.h"
#include "models/noise/wv_covariance.h"

namespace imuscope {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// What is known of a logarithm that the record says nothing of: three orders of magnitude either way. A
/// combination that the record does determine does not feel it.
constexpr double kPriorLogSd = 3.0;

MatrixXd parameter_covariance(const noise::FitResult& fit, const noise::WaveletVariance& wv,
                              const std::vector<int>& levels, const MatrixXd& jacobian) {
  MatrixXd v = noise::wv_covariance(fit.model, wv, levels.size());
  for (Index i = 0; i < v.rows(); ++i) {
    const double share = fit.model_error * noise::model_wv(fit.model, levels[static_cast<std::size_t>(i)]);
    v(i, i) += share * share;
  }
  MatrixXd information = jacobian.transpose() * v.ldlt().solve(jacobian);
  information.diagonal().array() += 1.0 / (kPriorLogSd * kPriorLogSd);
  return information.ldlt().solve(MatrixXd::Identity(information.rows(), information.cols()));
}

}  // namespace

NoiseUncertainty::NoiseUncertainty(const std::vector<ColumnLevel>& columns, const noise::FitResult& fit,
                                   const noise::WaveletVariance& wv) {
  std::vector<int> wv_levels;
  for (const auto& level : wv.levels) wv_levels.push_back(level.level);
  const auto places = noise::parameter_places(fit.model);
  covariance_ = parameter_covariance(fit, wv, wv_levels, noise::wv_jacobian(fit.model, wv_levels, places));
  for (const ColumnLevel& column : columns) {
    // D-8: the scale's weight in I_j, and how nu_j follows the parameters
    const double nu = noise::model_wv(fit.model, column.level);
    const double samples_per_coefficient = static_cast<double>(std::uint64_t{1} << unsigned(column.level));
    const double weight = static_cast<double>(wv.n_valid) / (samples_per_coefficient * nu);
    const VectorXd gradient = noise::wv_jacobian(fit.model, {column.level}, places).row(0).transpose() / nu;
    levels_.push_back({weight * column.products, gradient});
  }
}

NoiseUncertainty NoiseUncertainty::of(const std::vector<Index>& columns) const {
  NoiseUncertainty some;
  some.covariance_ = covariance_;
  for (const Level& level : levels_)
    some.levels_.push_back({level.information(columns, columns), level.log_gradient});
  return some;
}

// D-8: g, then g' C g
double NoiseUncertainty::relative_variance(const MatrixXd& phi, const VectorXd& a) const {
  const VectorXd b = phi * a;
  VectorXd gradient = VectorXd::Zero(covariance_.rows());
  for (const Level& level : levels_) gradient += b.dot(level.information * b) * level.log_gradient;
  gradient /= a.dot(b);
  return gradient.dot(covariance_ * gradient);
}

}  // namespace imuscope
