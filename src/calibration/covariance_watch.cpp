#include "calibration/covariance_watch.h"

#include <cmath>

#include "base/contracts.h"

namespace imuscope {

std::optional<std::size_t> CovarianceWatch::first_bad_state(const CovarianceKernel& P) noexcept {
  const std::size_t n = P.dimension();
  IMUSCOPE_EXPECTS(n * n == factor_.size());
  for (std::size_t i = 0; i < n; ++i) {
    double* const row = factor_.data() + i * n;
    const double variance = P(i, i);
    double pivot = 1.0;
    for (std::size_t j = 0; j < i; ++j) {
      const double* const other = factor_.data() + j * n;
      double sum = 0.0;
      if (variance != 0.0 && P(j, j) != 0.0) {
        sum = P(i, j) / std::sqrt(variance * P(j, j));
        for (std::size_t k = 0; k < j; ++k) sum -= row[k] * other[k];
        sum /= other[j];
      }
      row[j] = sum;
      pivot -= sum * sum;
    }
    if (!(variance >= 0.0) || !(pivot > kPivotMin)) return i;
    row[i] = std::sqrt(pivot);
  }
  return std::nullopt;
}

}  // namespace imuscope
