#pragma once

/// Vibration lines (an engine, a fan) in a signal: found against the noise around them in its spectrum, and
/// taken out as sinusoids, so that a noise model is fitted to what is noise.

#include <cstdint>
#include <span>
#include <vector>

namespace imuscope::noise {

/// A sinusoid that stands out of the spectrum, as it was over all segments of the signal.
struct Line {
  double frequency_hz = 0.0;
  double frequency_sd_hz = 0.0;  ///< from noise alone; an engine's speed wanders by more
  double amplitude = 0.0;        ///< of the sinusoid, signal unit, rms over the segments times sqrt(2)
  double amplitude_sd = 0.0;     ///< from noise alone
  double share_of_variance = 0.0;
  double p_value = 1.0;  ///< of noise alone reaching this anywhere in the spectrum
};

/// Sampling rate of the signal, and what counts as a line in it.
struct LineOptions {
  double rate_hz = 100.0;
  /// Chance of any false line in one signal.
  double false_alarm = 1e-3;
  /// Samples a segment of the spectrum, a power of two: lines closer than 4 rate / segment are one.
  std::size_t segment = 4096;
  /// Below this bin the noise of sensors rises: slow processes, not lines. Never below 43.
  std::size_t first_bin = 43;
  std::size_t most_lines = 6;
};

/// Strongest first. Only runs of valid samples as long as a segment are looked at; without any, none are
/// found. A peak wider than the window's main lobe is a band, not a line, and is passed over.
std::vector<Line> find_lines(std::span<const double> x, std::span<const std::uint8_t> mask,
                             const LineOptions& options);

/// What a line contributes to the wavelet variance of a level, as a sinusoid of random phase (N-5).
double line_wv(const Line& line, double rate_hz, int level);

/// Takes the lines out in place: in blocks of `segment` samples of every valid run, sine and cosine of each
/// by least squares, so that amplitude and phase may wander from block to block.
void remove_lines(std::span<double> x, std::span<const std::uint8_t> mask, const std::vector<Line>& lines,
                  const LineOptions& options);

}  // namespace imuscope::noise
