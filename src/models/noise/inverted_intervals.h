#pragma once

/// Intervals by inversion of a test: a value of a parameter belongs to the interval if the data do not reject
/// it. They hold where a record is short beside a process, where the estimate's own covariance does not:
/// chance that makes a slow process small makes its sd small too. Under each value the weights are those of
/// that value.

#include <vector>

#include "models/noise/fit.h"

namespace imuscope::noise {

/// Replaces the intervals of those parameters whose log-sd is not small or owes much to a rate that is
/// hardly known (loose_rates.h), and gives an interval to those that have none. Where the data do not tell
/// which of several sets of processes it was (one of them elsewhere, the others in its place), the interval
/// reaches over all of those (G-36). An end that the data do not tell is absent: "below", "above". A term of
/// amplitude zero gets the upper end of its amplitude. Cost: tens of milliseconds a parameter.
/// @param result   fitted to the first `levels` of `wv` with optimal weights
/// @param leaning  its parameters that lean on loose rates
void invert_intervals(FitResult& result, const WaveletVariance& wv, std::size_t levels,
                      const std::vector<bool>& leaning, CovarianceTables* tables);

}  // namespace imuscope::noise
