#pragma once

/// Welch's mean periodogram of a signal with missing samples: what lines and resonances are looked for in,
/// and what is drawn beside a wavelet variance (G-23).

#include <bit>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "base/for_each_index.h"
#include "models/noise/haar_levels.h"

namespace imuscope::noise {

/// Samples that are there, and how many of them before each place.
class Present {
 public:
  Present(std::span<const double> x, std::span<const std::uint8_t> mask);

  [[nodiscard]] const std::vector<Segment>& runs() const { return runs_; }
  [[nodiscard]] bool at(std::size_t i) const {
    return words_.empty() || (words_[i / kWord].there >> (i % kWord) & 1U) != 0;
  }
  [[nodiscard]] std::size_t count(std::size_t begin, std::size_t end) const {
    return before(end) - before(begin);
  }

  /// Where segments of `length` begin, half overlapping, of which at most an eighth is missing.
  [[nodiscard]] std::vector<std::size_t> segments(std::size_t length) const;

 private:
  /// A bit for each of so many neighbouring samples. A count for every sample would take half their memory.
  static constexpr std::size_t kWord = 64;
  struct Word {
    std::uint64_t there = 0;
    std::uint64_t before = 0;  ///< that are there before its first sample
  };

  [[nodiscard]] std::size_t before(std::size_t i) const {
    if (words_.empty()) return i;
    const Word& word = words_[i / kWord];
    const std::uint64_t earlier = (std::uint64_t{1} << (i % kWord)) - 1;
    return word.before + static_cast<std::size_t>(std::popcount(word.there & earlier));
  }

  std::vector<Segment> runs_;
  std::vector<Word> words_;  ///< empty where all are there
  std::size_t size_ = 0;
};

/// Mean periodogram of overlapping segments under a Hann window.
struct Spectrum {
  std::size_t length = 0;     ///< samples a segment
  std::vector<double> power;  ///< mean |X_k|^2 of the windowed segments, k = 0 .. length / 2
  std::size_t segments = 0;
};

/// A missing sample counts as the segment's mean; what the window loses by that is made up for, so that a
/// line keeps its amplitude.
Spectrum spectrum_of(std::span<const double> x, const Present& present, std::size_t length);

/// Spectra of one signal, each made when it is first asked for, so that all that looks at segments of one length
/// shares them. For one thread.
class Spectra {
 public:
  /// What is handed in must outlive this, as it is.
  Spectra(std::span<const double> x, std::span<const std::uint8_t> mask) : x_(x), present_(x, mask) {}

  [[nodiscard]] std::span<const double> samples() const { return x_; }
  [[nodiscard]] const Present& present() const { return present_; }
  const Spectrum& of(std::size_t length);

  /// Makes those of all these lengths.
  void make(std::span<const std::size_t> lengths, const ForEachIndex& for_each = one_by_one);

 private:
  std::span<const double> x_;
  Present present_;
  std::map<std::size_t, Spectrum> made_;
};

/// Degrees of freedom of a bin: Hann windows that overlap by half (Welch 1967), 36 K^2 / (19 K - 1).
double degrees_of_freedom(double segments);

/// Samples of the shortest segments of a density.
inline constexpr std::size_t kShortestOfDensity = 256;

/// One-sided power spectral density with its interval.
struct DensityPoint {
  double frequency_hz = 0.0;
  double density = 0.0;  ///< signal unit^2 / Hz
  double ci_low = 0.0;
  double ci_high = 0.0;
};

/// Density over the whole range that the record tells, equally dense on a logarithmic scale: short segments
/// for what is fast, longer ones below, up to a million samples. Empty for a signal without a segment of `shortest` samples.
std::vector<DensityPoint> density_of(Spectra& spectra, double rate_hz, double confidence = 0.95,
                                     int points_per_octave = 8, std::size_t shortest = kShortestOfDensity);

/// Segments whose spectra density_of() asks for.
std::vector<std::size_t> segments_of_density(const Spectra& spectra,
                                             std::size_t shortest = kShortestOfDensity);

/// One-sided density of a bin of `spectrum`, signal unit^2 / Hz.
double density_at(const Spectrum& spectrum, std::size_t bin, double rate_hz);

}  // namespace imuscope::noise
