#pragma once

/// Multiple linear regression of one error axis on the dynamics, from sums that are fed row by row: bounded
/// memory at any length. Whitened rows (models/noise/whitener.h) make it generalised least squares.
///
///   y = nuisance * gamma + covariates * beta + noise
///
/// Nuisance columns (the intercept, and what calibration errors would produce) are always in the model; the
/// F test is of beta = 0 given them, and R^2 the share of what they leave that beta explains (D-4 to D-6 in
/// EQUATIONS.md).

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "models/dynamics/noise_uncertainty.h"

namespace imuscope {

/// What the error changes by per unit of one covariate, with the interval at solve()'s confidence.
struct RegressionCoefficient {
  std::size_t covariate = 0;  ///< index among the covariates
  double value = 0.0;
  double sd = 0.0;
  double ci_low = 0.0;
  double ci_high = 0.0;
  double dof = 0.0;      ///< of its sd
  double p_value = 0.0;  ///< of value = 0, two-sided
};

/// Why a covariate has no coefficient.
enum class LeftOut : std::uint8_t {
  kConstant,   ///< does not vary
  kCollinear,  ///< a combination of the columns before it
};

struct Regression {
  std::size_t n = 0;
  double r2 = 0.0;
  double f = 0.0;
  int dof_model = 0;      ///< covariates tested
  double dof_rest = 0.0;  ///< n - columns; fewer where the noise's model is an estimate
  double p_value = 1.0;
  double residual_variance = 0.0;
  std::vector<RegressionCoefficient> coefficients;
  std::vector<std::pair<std::size_t, LeftOut>> left_out;
};

/// Thread: owner. Allocates in the constructor and in solve().
class RegressionSums {
 public:
  RegressionSums(std::size_t nuisance, std::size_t covariates);

  /// One row: nuisance columns with the intercept first, covariates, then y; size nuisance + covariates + 1.
  /// All finite.
  void add(std::span<const double> row);
  [[nodiscard]] std::size_t count() const { return n_; }

  /// @param confidence  of the intervals, in (0, 1)
  /// @param noise       of the model that whitened the rows, over all columns; null where it is known
  /// Absent with fewer rows than columns + 1, or with no covariate that varies.
  [[nodiscard]] std::optional<Regression> solve(double confidence = 0.95,
                                                const NoiseUncertainty* noise = nullptr) const;

  /// Coefficients of all columns, nuisance first; zero for columns without information of their own.
  [[nodiscard]] Eigen::VectorXd all_coefficients() const;
  /// Their covariance where the rows' noise has variance 1; zero likewise.
  [[nodiscard]] Eigen::MatrixXd all_covariances() const;

 private:
  std::size_t nuisance_;
  std::size_t covariates_;
  std::size_t n_ = 0;
  /// Rows are gathered in blocks, so that the sums are made by one product a block.
  Eigen::MatrixXd block_;
  Eigen::Index in_block_ = 0;
  Eigen::MatrixXd gram_;
  [[nodiscard]] Eigen::MatrixXd gram() const;
};

}  // namespace imuscope
