#pragma once

/// Intervals of amplitudes that stand beside a Gauss-Markov process whose rate is hardly known. A fast one
/// takes over part of the white noise, the more the faster it is, and the share bends with the rate: the sd
/// that holds at the estimated rate is too small where the data allow other rates.

#include <Eigen/Core>
#include <vector>

#include "models/noise/fit.h"
#include "models/noise/inference.h"

namespace imuscope::noise {

/// A Gauss-Markov process known no better than this, sd of the logarithm of its rate, may stand elsewhere as
/// well.
inline constexpr double kLooseLogSd = 0.25;

/// Which parameters owe a tenth of their variance or more to the rate of one such process that is not their
/// own.
/// @param parameters  of the estimate, in whatever the data determine of it
std::vector<bool> leaning_on_loose_rates(const Model& model, const ParameterCovariance& parameters);

/// G-43. Replaces the intervals of those amplitudes that lean on loose rates and are not loose themselves.
/// Under the weights of the estimate the amplitudes are linear at each rate, so that this costs some least
/// squares of a few columns. An interval that reaches down to zero has no lower end. Precondition: optimal
/// weights.
/// @param whitener  of the levels that were fitted
void profile_loose_rates(FitResult& result, const ParameterCovariance& parameters,
                         const Eigen::MatrixXd& whitener);

}  // namespace imuscope::noise
