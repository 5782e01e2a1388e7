#include "models/dynamics/regression.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <boost/math/distributions/fisher_f.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>

#include "base/contracts.h"

namespace imuscope {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kBlockRows = 256;
/// A column of which less than this share is left beside the columns before it is their combination.
constexpr double kCollinearShare = 1e-9;

/// Columns of the model that carry information of their own, in order.
struct Columns {
  std::vector<Index> kept;
  std::vector<std::pair<std::size_t, LeftOut>> left_out;
};

/// Gram-Schmidt on the sums: a column is kept when enough of it is left beside those kept before it.
Columns independent_columns(const MatrixXd& gram, Index nuisance, Index covariates) {
  Columns columns;
  MatrixXd rest = gram;
  for (Index i = 0; i < nuisance + covariates; ++i) {
    const double before = gram(i, i);
    if (before > 0.0 && rest(i, i) > kCollinearShare * before) {
      columns.kept.push_back(i);
      const VectorXd column = rest.col(i) / std::sqrt(rest(i, i));
      rest -= column * column.transpose();
      continue;
    }
    if (i < nuisance) continue;
    // Against the intercept alone, which is the first column and never zero where another one is not.
    const bool constant =
        before <= 0.0 || before - gram(0, i) * gram(0, i) / gram(0, 0) <= kCollinearShare * before;
    columns.left_out.emplace_back(static_cast<std::size_t>(i - nuisance),
                                  constant ? LeftOut::kConstant : LeftOut::kCollinear);
  }
  return columns;
}

struct Solution {
  VectorXd beta;
  MatrixXd phi;  ///< inverse normal matrix
  double rss = 0.0;
};

/// D-4: least squares on the columns `kept`, from the sums, columns scaled to one.
Solution least_squares(const MatrixXd& gram, const std::vector<Index>& kept) {
  const auto n = static_cast<Index>(kept.size());
  const Index y = gram.rows() - 1;
  VectorXd scale(n);
  for (Index i = 0; i < n; ++i)
    scale(i) = 1.0 / std::sqrt(gram(kept[static_cast<std::size_t>(i)], kept[static_cast<std::size_t>(i)]));
  MatrixXd normal(n, n);
  VectorXd right(n);
  for (Index i = 0; i < n; ++i) {
    const Index row = kept[static_cast<std::size_t>(i)];
    right(i) = scale(i) * gram(row, y);
    for (Index j = 0; j < n; ++j) {
      normal(i, j) = scale(i) * scale(j) * gram(row, kept[static_cast<std::size_t>(j)]);
    }
  }
  const Eigen::LLT<MatrixXd> factor(normal);
  const VectorXd scaled = factor.solve(right);
  const MatrixXd inverse = factor.solve(MatrixXd::Identity(n, n));
  return {scale.cwiseProduct(scaled), scale.asDiagonal() * inverse * scale.asDiagonal(),
          gram(y, y) - right.dot(scaled)};
}

/// D-8: degrees of freedom of a variance from its relative variance by the noise's model and from the residual's
/// own (Satterthwaite 1946).
double degrees_of_freedom(double relative_variance, double of_residual) {
  return 1.0 / (0.5 * relative_variance + 1.0 / of_residual);
}

/// D-8: denominator of the F test of the columns from `first` on: independent contrasts, each with its degrees of
/// freedom, give an F of that expectation (Fai and Cornelius 1996).
double f_degrees_of_freedom(const MatrixXd& phi, Index first, const NoiseUncertainty& noise,
                            double of_residual) {
  const Index tested = phi.rows() - first;
  const MatrixXd block = phi.bottomRightCorner(tested, tested);
  const VectorXd scale = block.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> contrasts(scale.asDiagonal() * block * scale.asDiagonal());
  double expectation = 0.0;
  double fewest = of_residual;
  for (Index i = 0; i < tested; ++i) {
    VectorXd a = VectorXd::Zero(phi.rows());
    a.tail(tested) = scale.cwiseProduct(contrasts.eigenvectors().col(i));
    const double dof = degrees_of_freedom(noise.relative_variance(phi, a), of_residual);
    fewest = std::min(fewest, dof);
    if (dof > 2.0) expectation += dof / (dof - 2.0);
  }
  const auto q = static_cast<double>(tested);
  return expectation > q ? std::min(of_residual, 2.0 * expectation / (expectation - q)) : fewest;
}

}  // namespace

RegressionSums::RegressionSums(std::size_t nuisance, std::size_t covariates)
    : nuisance_(nuisance),
      covariates_(covariates),
      block_(MatrixXd::Zero(kBlockRows, static_cast<Index>(nuisance + covariates + 1))),
      gram_(MatrixXd::Zero(block_.cols(), block_.cols())) {
  IMUSCOPE_EXPECTS(nuisance >= 1 && covariates >= 1);
}

void RegressionSums::add(std::span<const double> row) {
  IMUSCOPE_EXPECTS(row.size() == static_cast<std::size_t>(block_.cols()));
  block_.row(in_block_) = Eigen::Map<const Eigen::RowVectorXd>(row.data(), block_.cols());
  ++n_;
  if (++in_block_ < kBlockRows) return;
  gram_.noalias() += block_.transpose() * block_;
  in_block_ = 0;
}

Eigen::MatrixXd RegressionSums::gram() const {
  const auto open = block_.topRows(in_block_);
  return gram_ + open.transpose() * open;
}

Eigen::VectorXd RegressionSums::all_coefficients() const {
  const MatrixXd sums = gram();
  const Columns columns =
      independent_columns(sums, static_cast<Index>(nuisance_), static_cast<Index>(covariates_));
  VectorXd coefficients = VectorXd::Zero(sums.rows() - 1);
  if (columns.kept.empty()) return coefficients;
  const VectorXd beta = least_squares(sums, columns.kept).beta;
  for (std::size_t i = 0; i < columns.kept.size(); ++i) {
    coefficients(columns.kept[i]) = beta(static_cast<Index>(i));
  }
  return coefficients;
}

Eigen::MatrixXd RegressionSums::all_covariances() const {
  const MatrixXd sums = gram();
  const Columns columns =
      independent_columns(sums, static_cast<Index>(nuisance_), static_cast<Index>(covariates_));
  MatrixXd covariances = MatrixXd::Zero(sums.rows() - 1, sums.rows() - 1);
  if (!columns.kept.empty()) covariances(columns.kept, columns.kept) = least_squares(sums, columns.kept).phi;
  return covariances;
}

std::optional<Regression> RegressionSums::solve(double confidence, const NoiseUncertainty* noise) const {
  const MatrixXd sums = gram();
  const auto nuisance = static_cast<Index>(nuisance_);
  const Columns columns = independent_columns(sums, nuisance, static_cast<Index>(covariates_));
  std::vector<Index> null_columns;
  for (const Index i : columns.kept) {
    if (i < nuisance) null_columns.push_back(i);
  }
  const auto tested = columns.kept.size() - null_columns.size();
  if (tested == 0 || n_ <= columns.kept.size()) return std::nullopt;

  const Solution full = least_squares(sums, columns.kept);
  const double null_rss = least_squares(sums, null_columns).rss;

  Regression result;
  result.n = n_;
  result.left_out = columns.left_out;
  result.dof_model = static_cast<int>(tested);
  result.dof_rest = static_cast<double>(n_ - columns.kept.size());
  result.residual_variance = full.rss / result.dof_rest;  // D-4: s^2
  // D-5
  result.r2 = null_rss > 0.0 ? 1.0 - full.rss / null_rss : 0.0;
  if (!(result.residual_variance > 0.0)) return std::nullopt;
  result.f = (null_rss - full.rss) / static_cast<double>(tested) / result.residual_variance;
  const double of_residual = result.dof_rest;
  const auto first = static_cast<Index>(null_columns.size());
  std::optional<NoiseUncertainty> of_kept;
  if (noise != nullptr) {
    of_kept = noise->of(columns.kept);
    result.dof_rest = f_degrees_of_freedom(full.phi, first, *of_kept, of_residual);
  }
  const boost::math::fisher_f f_distribution(static_cast<double>(tested), result.dof_rest);
  result.p_value = boost::math::cdf(boost::math::complement(f_distribution, std::max(result.f, 0.0)));

  for (Index at = first; at < full.phi.rows(); ++at) {
    RegressionCoefficient c;
    c.covariate = static_cast<std::size_t>(columns.kept[static_cast<std::size_t>(at)] - nuisance);
    c.value = full.beta(at);
    c.sd = std::sqrt(result.residual_variance * full.phi(at, at));
    c.dof = of_kept
                ? degrees_of_freedom(
                      of_kept->relative_variance(full.phi, VectorXd::Unit(full.phi.rows(), at)), of_residual)
                : of_residual;
    const boost::math::students_t t_distribution(c.dof);
    const double quantile = boost::math::quantile(t_distribution, 0.5 * (1.0 + confidence));
    c.ci_low = c.value - quantile * c.sd;
    c.ci_high = c.value + quantile * c.sd;
    c.p_value = 2.0 * boost::math::cdf(boost::math::complement(t_distribution, std::abs(c.value) / c.sd));
    result.coefficients.push_back(c);
  }
  return result;
}

}  // namespace imuscope
