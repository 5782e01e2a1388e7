#pragma once

/// A signal as everybody's fit begins: its sinusoids found and, where wanted, taken out; its wavelet
/// variance; a word where it is spiky.

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "models/noise/lines.h"
#include "models/noise/wavelet_variance.h"

namespace imuscope::noise {

/// Whether sinusoids (an engine, a fan, a building) stay in the signal and are told of, or are taken out.
enum class Lines : std::uint8_t { kStay, kTakenOut };

/// What a model is fitted to, and what a person should know of it.
struct SignalLook {
  WaveletVariance wv;                 ///< of what the lines left, where they were taken out
  std::vector<Line> lines;            ///< strongest first
  std::optional<std::string> spikes;  ///< a sentence where there are some that `wv` does not resist
};

/// Errors: those of haar_wavelet_variance(). Memory beyond the input: a byte a sample, a copy of the signal
/// where lines are taken out, and what the wavelet variance needs.
/// @param options  the same for every wavelet variance that is made
Result<SignalLook> look_at_signal(std::span<const double> x, const WvOptions& options, double rate_hz,
                                  Lines lines);

}  // namespace imuscope::noise
