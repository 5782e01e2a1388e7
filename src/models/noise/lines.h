#pragma once

/// Vibration lines (an engine, a fan) in a signal: found against the noise around them in its spectrum, and
/// taken out as sinusoids, so that a noise model is fitted to what is noise.

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "models/noise/spectrum.h"
#include "models/noise/wavelet_variance.h"

namespace imuscope::noise {

/// A sinusoid that stands out of the spectrum, as it was over all segments of the signal.
struct Line {
  double frequency_hz = 0.0;
  double frequency_sd_hz = 0.0;  ///< from noise alone; an engine's speed wanders by more
  double amplitude = 0.0;        ///< of the sinusoid, signal unit, rms over the segments times sqrt(2)
  double amplitude_sd = 0.0;     ///< from noise alone
  double share_of_variance = 0.0;
  double p_value = 1.0;     ///< of noise alone reaching this anywhere in the spectrum
  std::size_t segment = 0;  ///< samples a segment of the spectrum in which it was found
};

/// Sampling rate of the signal, and what counts as a line in it.
struct LineOptions {
  double rate_hz = 100.0;
  /// Chance of any false line in one signal.
  double false_alarm = 1e-3;
  /// Samples of the shortest segments of the spectrum, a power of two: lines closer than 4 rate / segment are
  /// one. Below its 43rd bin, segments of four times the length take over, and so on down to `lowest_hz`.
  std::size_t segment = 4096;
  double lowest_hz = 0.05;
  std::size_t most_lines = 16;
};

/// Strongest first. A segment of the spectrum may miss an eighth of its samples; a signal that has none of
/// the shortest has no lines, and longer ones are looked at where there are kFewestSegments. A peak wider
/// than the window's main lobe is a band, not a line, and is passed over.
std::vector<Line> find_lines(std::span<const double> x, std::span<const std::uint8_t> mask,
                             const LineOptions& options);

/// The same by spectra that others look at, too.
std::vector<Line> find_lines(Spectra& spectra, const LineOptions& options);

/// Segments whose spectra find_lines() asks for.
std::vector<std::size_t> segments_of_lines(const Spectra& spectra, const LineOptions& options);

/// What a line contributes to the wavelet variance of a level, as a sinusoid of random phase (G-5).
double line_wv(const Line& line, double rate_hz, int level);

/// "a line at 0.565 Hz, amplitude 0.0021 m/s^2 (2.1 % of the variance)".
std::string in_words(const Line& line, std::string_view unit);

/// Takes the lines out in place: in blocks of each line's segment, sine and cosine by least squares of the
/// samples that are there, so that amplitude and phase may wander from block to block.
void remove_lines(std::span<double> x, std::span<const std::uint8_t> mask, const std::vector<Line>& lines,
                  double rate_hz);

/// About a line, a signal without it is not its noise: what the line wandered within a block is still there, and the
/// sinusoids took some of the noise. Both are told by the spectrum beside the line. Empty without lines.
class Remainders {
 public:
  Remainders() = default;
  /// @param without  the signal without the lines
  Remainders(Spectra& without, const std::vector<Line>& lines, double rate_hz);

  [[nodiscard]] bool empty() const { return bins_.empty(); }
  /// What they contribute to the wavelet variance whose neighbouring means are of n samples: half the Allan variance.
  /// Negative where more is missing than was left.
  [[nodiscard]] double wv(double n) const;
  /// A variance that they are part of, without them. Where they are most of it, half of it: the noise is not known so
  /// much better than that.
  [[nodiscard]] double taken_out_of(double variance, double n) const;
  /// The same of all levels, with their intervals.
  void take_out_of(WaveletVariance& wv, double confidence) const;

 private:
  struct Bin {
    double omega_rad;  ///< a sample
    double variance;   ///< above the noise beside the line, or below it
  };
  std::vector<Bin> bins_;
};

}  // namespace imuscope::noise
