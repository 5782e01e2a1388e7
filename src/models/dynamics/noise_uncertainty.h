#pragma once

/// How well a fitted noise model is known, as a regression whitened by it feels it: the variance that each
/// coefficient is said to have is itself an estimate, and its degrees of freedom follow from the model's
/// covariance and from the scales at which the columns tell (D-8 in EQUATIONS.md).

#include <Eigen/Core>
#include <vector>

#include "models/dynamics/column_wavelets.h"
#include "models/noise/fit.h"
#include "models/noise/wavelet_variance.h"

namespace imuscope {

class NoiseUncertainty {
 public:
  /// @param columns  of the regression, in the order of its sums
  /// @param wv       that `fit` was fitted to
  NoiseUncertainty(const std::vector<ColumnLevel>& columns, const noise::FitResult& fit,
                   const noise::WaveletVariance& wv);

  /// The same for some of the columns.
  [[nodiscard]] NoiseUncertainty of(const std::vector<Eigen::Index>& columns) const;

  /// Relative variance of the variance a' phi a, phi the columns' covariance under the model.
  [[nodiscard]] double relative_variance(const Eigen::MatrixXd& phi, const Eigen::VectorXd& a) const;

 private:
  NoiseUncertainty() = default;

  struct Level {
    Eigen::MatrixXd information;   ///< of this scale, in the columns' inverse covariance
    Eigen::VectorXd log_gradient;  ///< of the model's wavelet variance, by its parameters
  };
  std::vector<Level> levels_;
  Eigen::MatrixXd covariance_;  ///< of the parameters, on their interval scale
};

}  // namespace imuscope
