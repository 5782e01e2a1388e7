#pragma once

/// Tukey-biweight M-estimator of a squared scale: the largest root s2 of
///   mean( r^2 (1 - (r/c)^2)^4 [|r| <= c] ) = a(c),  r = w / sqrt(s2),
/// a(c) being the same mean under N(0,1).

#include <span>

namespace imuscope::noise {

/// The constant c at which the estimator has `efficiency` on Gaussian data. 0.2 <= efficiency <= 0.99.
double biweight_constant(double efficiency);

/// Efficiency of the estimator with constant c on Gaussian data.
double biweight_efficiency(double c);

/// a(c).
double biweight_expectation(double c);

struct RobustScale {
  double s2 = 0.0;              ///< 0 where more than about two thirds of the data are exactly zero
  double rejected_share = 0.0;  ///< share of the data with weight zero, |r| > c
};

RobustScale biweight_scale(std::span<const double> w, double c);

}  // namespace imuscope::noise
