#pragma once

/// Whether several records come from one model, and what each of them says of its parameters.

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "models/noise/fit.h"

namespace imuscope::noise {

/// What one record says of the parameters about a common model, linearised there.
struct UnitEstimate {
  Eigen::VectorXd step;        ///< from the common model, on the scales of the parameters' intervals
  Eigen::MatrixXd covariance;  ///< of the step
};

/// Records beside a model that was fitted to all of them together.
struct Homogeneity {
  /// Score test that all records have the common parameters, its p-value by a parametric bootstrap: wavelet
  /// variances are drawn under the common model with the skewness that their degrees of freedom give them,
  /// and nothing is taken for Gaussian. Absent where no parameter is in use.
  std::optional<JTest> test;
  std::vector<UnitEstimate> units;  ///< parameters at zero have NaN
};

/// Deterministic: the same records, the same p-value.
/// @param model_errors  share by which a model of that kind misses the levels of each record
///                      (FitResult::model_error): no difference is made of it. Empty: none.
Homogeneity test_homogeneity(std::span<const WaveletVariance> records, const Model& common,
                             std::span<const double> model_errors = {});

}  // namespace imuscope::noise
