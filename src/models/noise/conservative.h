#pragma once

/// Parameters that a filter may trust: a model that lies above what the data allow, not through its middle.

#include "models/noise/fit.h"

namespace imuscope::noise {

/// The fit with larger amplitudes, rates unchanged: the smallest relative increase (sum of squares) with
/// which the model reaches the upper end of the model-based interval at every level that has enough
/// coefficients (wavelet_variance.h). Terms of amplitude zero stay out. The parameters carry no intervals.
FitResult over_bounding(const FitResult& fit);

/// An over-bounding model with an amplitude (a variance) larger than the fit's by more than this tells of a
/// model that misses the data, not of noise.
inline constexpr double kMostIncrease = 20.0;

/// The largest ratio of an amplitude of over_bounding(fit) to the fit's own; 1 where nothing had to grow.
double largest_increase(const FitResult& fit, const FitResult& bound);

}  // namespace imuscope::noise
