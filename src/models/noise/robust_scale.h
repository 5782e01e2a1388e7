#pragma once

/// Tukey-biweight M-estimator of a squared scale: the largest root s2 of
///   mean( r^2 (1 - (r/c)^2)^4 [|r| <= c] ) = a(c),  r = w / sqrt(s2),
/// a(c) being the same mean under N(0,1). Where there is no root, the s2 at which the mean comes closest to
/// a(c).

#include <span>
#include <vector>

namespace imuscope::noise {

/// The constant c at which the estimator has `efficiency` on Gaussian data. 0.2 <= efficiency <= 0.99.
double biweight_constant(double efficiency);

/// Efficiency of the estimator with constant c on Gaussian data.
double biweight_efficiency(double c);

/// a(c).
double biweight_expectation(double c);

/// How the estimates of two correlated Gaussian signals covary: for coefficients of correlation rho,
///   Cov / (s2_1 s2_2) = sum_m terms[m-1] rho^(2m),
/// from the Hermite expansion of the estimating function. The first term is 2, that of the classical
/// variance, and they sum to 2 / efficiency: what resistance costs, it costs at short correlation only. Two
/// terms or more.
std::vector<double> biweight_correlation_terms(double efficiency);

struct RobustScale {
  double s2 = 0.0;              ///< 0 where more than half of the data are exactly zero
  double rejected_share = 0.0;  ///< share of the data with weight zero, |r| > c
};

RobustScale biweight_scale(std::span<const double> w, double c);

}  // namespace imuscope::noise
