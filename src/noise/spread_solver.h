#pragma once

/// The variance at which a weighted sum of squares takes a value (Paule and Mandel 1982).

namespace imuscope::noise {

/// The variance >= 0 at which `q_at`, which falls with it, is `q`; 0 where it is not larger at 0 already.
/// @param first  a variance of the size that is expected, > 0
template <typename Function>
double variance_at(const Function& q_at, double q, double first) {
  if (q_at(0.0) <= q) return 0.0;
  double low = 0.0;
  double high = first;
  constexpr int kDoublings = 200;
  for (int i = 0; i < kDoublings && q_at(high) > q; ++i) {
    low = high;
    high *= 2.0;
  }
  constexpr int kHalvings = 60;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (low + high);
    // Nothing is left between them.
    if (middle <= low || middle >= high) break;
    (q_at(middle) > q ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace imuscope::noise
