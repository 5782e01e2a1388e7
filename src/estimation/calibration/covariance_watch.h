#pragma once

/// Watches that a covariance stays positive definite: Cholesky's factors of its correlation matrix, whose
/// pivots say which state has become a combination of the ones before it. K-6. Core; allocates in the
/// constructor only.

#include <cstddef>
#include <optional>
#include <vector>

#include "estimation/calibration/covariance_kernel.h"

namespace imuscope {

class CovarianceWatch {
 public:
  explicit CovarianceWatch(std::size_t dimension) : factor_(dimension * dimension), per_sd_(dimension) {}

  /// First state whose pivot is not above the limit, or not a number; none where all is well. States of zero
  /// variance (known exactly, or not in use) are passed over. Costs n^3 / 6 multiplications.
  [[nodiscard]] std::optional<std::size_t> first_bad_state(const CovarianceKernel& P) noexcept;

  /// Of a correlation matrix, whose diagonal is 1.
  static constexpr double kPivotMin = 1e-12;

 private:
  std::vector<double> factor_;  ///< rows of L
  std::vector<double> per_sd_;  ///< 1 / sd of each state; 0 where it has none
};

}  // namespace imuscope
