#pragma once

/// Which model an axis at rest gets.

#include "models/noise/select.h"

namespace imuscope::certificate {

/// The model that the record supports, grown from white noise, quantization, Gauss-Markov processes, flicker
/// noise, random walk and ramp; with a resonance where the spectrum shows one. `options.intervals` apply to
/// the winner.
Result<noise::GrownModel> select_model(const noise::WaveletVariance& wv, double rate_hz, bool has_resonance,
                                       const noise::FitOptions& options);

}  // namespace imuscope::certificate
