#pragma once

/// The variance at which a weighted sum of squares takes a value (Paule and Mandel 1982).

#include <cmath>
#include <optional>

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

/// A sum of squares at one variance, and what it falls by a unit of that.
struct SumOfSquares {
  double q = 0.0;
  double fall = 0.0;
};

/// The same by Newton's method on 1 / q, which for equal errors is a straight line: four looks instead of
/// fifty. Absent where it does not settle.
template <typename Function>
std::optional<double> variance_by_newton(const Function& sum_at, double q) {
  double variance = 0.0;
  SumOfSquares now = sum_at(variance);
  if (now.q <= q) return 0.0;
  constexpr int kRounds = 30;
  constexpr double kSettled = 1e-12;
  for (int i = 0; i < kRounds; ++i) {
    if (!(now.fall > 0.0)) return std::nullopt;
    const double step = (now.q * now.q / q - now.q) / now.fall;
    const double next = variance + step;
    if (!(next >= 0.0) || !std::isfinite(next)) return std::nullopt;
    if (std::abs(step) <= kSettled * next) return next;
    variance = next;
    now = sum_at(variance);
  }
  return std::nullopt;
}

}  // namespace imuscope::noise
