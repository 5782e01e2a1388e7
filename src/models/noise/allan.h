#pragma once

/// Overlapping Allan deviation, dense in the averaging time, with intervals that follow from a fitted model.

#include <cstdint>
#include <span>
#include <vector>

#include "models/noise/fit.h"
#include "models/noise/lines.h"

namespace imuscope::noise {

class CovarianceTable;

/// AVAR(n) = half the mean square of the difference of neighbouring means of n samples, over all places (IEEE
/// Std 952, annex C): twice the wavelet variance at n = 2^(level-1) (G-40).
struct AllanPoint {
  std::uint64_t n = 0;  ///< samples a mean
  double tau_s = 0.0;
  double deviation = 0.0;  ///< signal unit
  std::uint64_t n_differences = 0;
  double degrees_of_freedom = 0.0;  ///< equivalent, of the variance; set by set_allan_intervals()
  double ci_low = 0.0;
  double ci_high = 0.0;
};

/// Averaging times of powers of two samples are those of `wv`; between them lie `points_per_octave - 1` more,
/// up to the longest level with enough coefficients (wavelet_variance.h) or, without one, the longest at all.
/// Missing samples are borne as in haar_wavelet_variance(), and what they add is taken out by the
/// neighbouring levels' inflation.
/// @param x   used up: its sums take its place (one more than samples: reserve that, and nothing is moved)
/// @param wv  of the same signal and mask, classical
/// @param remainders  of the lines that were taken out of the signal, and out of `wv`
std::vector<AllanPoint> allan_deviation(std::vector<double> x, const WaveletVariance& wv, double rate_hz,
                                        int points_per_octave = 4, const Remainders& remainders = {});

/// Chi-square intervals. Their degrees of freedom are those of the wavelet variance under the fitted model
/// (G-8), between levels on a logarithmic scale; without a fit max(N / 2n, 1).
/// @param table  of the fit's record; nothing: its covariance is computed by itself
void set_allan_intervals(std::vector<AllanPoint>& points, const FitResult* fit, double confidence,
                         const CovarianceTable* table = nullptr);

/// Allan deviation of the model for means of n samples; n need not be a power of two.
double model_allan_deviation(const Model& model, double n);

}  // namespace imuscope::noise
