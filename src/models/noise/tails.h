#pragma once

/// Heavy tails: are there more large values in a signal than in a Gaussian one? Spikes raise the classical
/// wavelet variance and leave the robust one alone, so that their difference tells (Hausman 1978). Its
/// covariance follows from the model, as for Gaussian signals the classical one is the better (G-35).

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "models/noise/model.h"
#include "models/noise/wavelet_variance.h"

namespace imuscope::noise {

struct TailTest {
  double statistic = 0.0;  ///< chi-square
  int dof = 0;             ///< levels compared
  double p_value = 1.0;
  int level = 0;        ///< with the clearest difference
  double excess = 0.0;  ///< classical over robust less one, at that level
};

/// Below this chance a signal is called spiky: of a hundred clean ones, one is.
inline constexpr double kSpikesBelow = 0.01;
/// Slower levels hold so many samples in a coefficient that spikes are no outliers of theirs.
inline constexpr int kTailLevels = 8;

/// What the test looks at of a signal.
struct TailExcerpt {
  std::vector<double> values;
  std::vector<std::uint8_t> mask;  ///< one a value; zero between blocks, too
};

/// A quarter of a million samples at most, in blocks spread over the signal.
TailExcerpt tail_excerpt(std::span<const double> x, std::span<const std::uint8_t> mask);

/// Absent where quantization, which is no Gaussian process, makes a part of every level, or where no level
/// has enough coefficients.
/// @param options  gaps; its mask is not used
/// @param model    of that signal, in sample terms; the first eight levels count
std::optional<TailTest> test_tails(const TailExcerpt& excerpt, const WvOptions& options, const Model& model);

/// The same of a signal's excerpt.
/// @param options  mask and gaps
std::optional<TailTest> test_tails(std::span<const double> x, const WvOptions& options, const Model& model);

/// The sentence for a person, with what to do; absent where the test does not tell of spikes.
std::optional<std::string> spike_warning(const std::optional<TailTest>& test, double rate_hz);

}  // namespace imuscope::noise
