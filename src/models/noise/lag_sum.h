#pragma once

/// Of wv_covariance() and CovarianceTable alone: at which lags a covariance is summed, and with which
/// weights.

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace imuscope::noise {

/// Sum of f over the integers of [low, high], told to f by the places at which it is evaluated. Between its
/// break points f is smooth, the more so the further from them: each integer counts close to a break point,
/// then blocks of doubling length by the three-point rule that is exact for polynomials of degree five over
/// equally spaced points. F has add_at(h) for break points, and enter(p, q) with add_inside(h, weight) for
/// what lies between.
template <typename F>
class LagSum {
 public:
  LagSum(F& f, double exact_near) : f_(f), exact_(exact_near) {}

  void between(const std::vector<double>& breaks, double low, double high) {
    constexpr double kFar = std::numeric_limits<double>::infinity();
    double last = -kFar;
    for (const double b : breaks) {
      interval(last, b, low, high);
      if (b >= low && b <= high) f_.add_at(b);
      last = b;
    }
    interval(last, kFar, low, high);
  }

 private:
  /// Integers strictly between the break points p and q that lie in [low, high].
  void interval(double p, double q, double low, double high) {
    const double from = std::max(p + 1.0, low);
    const double to = std::min(q - 1.0, high);
    if (from > to) return;
    f_.enter(p, q);
    if (std::isinf(q)) return away(p, 1.0, from - p, to - p);
    if (std::isinf(p)) return away(q, -1.0, q - to, q - from);
    const double middle = std::floor(0.5 * (p + q));
    away(p, 1.0, from - p, std::min(to, middle) - p);
    away(q, -1.0, q - to, q - std::max(from, middle + 1.0));
  }

  /// Distances first..last from the break point at origin.
  void away(double origin, double sign, double first, double last) {
    double d = first;
    for (; d <= last && d <= exact_; d += 1.0) f_.add_inside(origin + sign * d, 1.0);
    while (d <= last) {
      const double length = std::min(d, last - d + 1.0);
      block(origin, sign, d, length);
      d += length;
    }
  }

  void block(double origin, double sign, double first, double length) {
    if (length < 4.0) {
      for (double d = first; d < first + length; d += 1.0) f_.add_inside(origin + sign * d, 1.0);
      return;
    }
    const double centre = first + 0.5 * (length - 1.0);
    const double second_moment = length * (length * length - 1.0) / 12.0;
    const double offset = std::sqrt((3.0 * length * length - 7.0) / 20.0);
    const double side = 0.5 * second_moment / (offset * offset);
    f_.add_inside(origin + sign * (centre - offset), side);
    f_.add_inside(origin + sign * (centre + offset), side);
    f_.add_inside(origin + sign * centre, length - 2.0 * side);
  }

  F& f_;
  double exact_;
};

}  // namespace imuscope::noise
