#pragma once

/// Flicker and other power-law noise as a sum of Gauss-Markov processes and white noise, for what needs a
/// state or an exponential covariance: filters, the covariance of the wavelet variance, growth of a bias.

#include <vector>

#include "models/noise/model.h"

namespace imuscope::noise {

/// Whether the component is FN or PL.
bool is_power_law(ProcessKind kind) noexcept;

/// The sum (G-39): rates a factor of eight apart from half a sample to beyond 2^24 samples, amplitudes by
/// non-negative least squares of the relative deviations of the wavelet variance at levels 1 to 24. It
/// follows the exact curve within kPowerLawSumError at each of them.
std::vector<Component> power_law_sum(const Component& power_law);

/// Most of |curve of the sum / exact curve - 1| for exponents of 0.3 to 1.7, levels 1 to 24.
inline constexpr double kPowerLawSumError = 0.02;

/// The model with every FN and PL in the form of its sum. GM are no longer in order of their rates.
Model without_power_laws(const Model& model);

}  // namespace imuscope::noise
