#include "estimation/calibration/covariance_watch.h"

#include <array>
#include <cmath>

#include "base/contracts.h"

namespace imuscope {
namespace {

/// Four sums side by side: one alone would wait for its own additions.
double dot(const double* a, const double* b, std::size_t n) noexcept {
  std::array<double, 4> sum{};
  std::size_t k = 0;
  for (; k + sum.size() <= n; k += sum.size()) {
    for (std::size_t lane = 0; lane < sum.size(); ++lane) sum[lane] += a[k + lane] * b[k + lane];
  }
  for (; k < n; ++k) sum[0] += a[k] * b[k];
  return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

}  // namespace

// K-6
std::optional<std::size_t> CovarianceWatch::first_bad_state(const CovarianceKernel& P) noexcept {
  const std::size_t n = P.dimension();
  IMUSCOPE_EXPECTS(n * n == factor_.size());
  for (std::size_t i = 0; i < n; ++i) per_sd_[i] = P(i, i) > 0.0 ? 1.0 / std::sqrt(P(i, i)) : 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    double* const row = factor_.data() + i * n;
    const double variance = P(i, i);
    double pivot = 1.0;
    for (std::size_t j = 0; j < i; ++j) {
      const double* const other = factor_.data() + j * n;
      const double per_variance = per_sd_[i] * per_sd_[j];
      const double sum = per_variance == 0.0 ? 0.0 : (P(i, j) * per_variance - dot(row, other, j)) / other[j];
      row[j] = sum;
      pivot -= sum * sum;
    }
    if (!(variance >= 0.0) || !(pivot > kPivotMin)) return i;
    row[i] = std::sqrt(pivot);
  }
  return std::nullopt;
}

}  // namespace imuscope
