#pragma once

/// Haar wavelet variance (maximal overlap) of a signal, whole or through a mask.
///
/// W_{j,t} = (mean of the n newest samples - mean of the n before) / 2, n = 2^(j-1); wv_j = mean of W_{j,t}^2
/// over all t (no mean subtraction). It is half the Allan variance at cluster size n. Of missing samples each
/// half bears up to an eighth of its own (haar_levels.h): the means are of those that are there, and what
/// their absence adds to the squares is taken out, so that single lost samples cost information and no scale.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/result.h"
#include "models/noise/haar_levels.h"

namespace imuscope::noise {

/// Stretches of coefficients that are told apart: beyond them, what is missing in between is missing at
/// random.
inline constexpr std::size_t kMostPlaces = 64;

/// Wavelet variance at one level, with its confidence interval.
struct WvLevel {
  int level = 0;             ///< j, from 1
  double tau_samples = 0.0;  ///< 2^j
  double value = 0.0;        ///< wavelet variance, signal unit squared
  double ci_low = 0.0;       ///< confidence interval, chi-square with max(M_j / 2^j, 1) degrees of freedom
  double ci_high = 0.0;
  std::uint64_t n_coefficients = 0;  ///< M_j
  double rejected_share = 0.0;       ///< robust only: share of coefficients with weight zero
  /// Mean square of the coefficients over `value`, which is less by what missing samples add; 1 without any.
  double inflation = 1.0;
  /// Stretches of the newest samples of its coefficients, joined over the shortest holes where there are more
  /// than kMostPlaces; empty: those of the runs of samples (of one run, and where that is not known).
  std::vector<Segment> places{};
};

/// Efficiency times M_j >= 3 * 2^j: near enough to Gaussian for tests and bounds. `efficiency` is that of the
/// wavelet variance that the level belongs to: an estimator that resists needs more coefficients for it.
bool has_enough_coefficients(const WvLevel& level, double efficiency) noexcept;

struct WaveletVariance {
  std::uint64_t n_samples = 0;    ///< length of the signal
  std::uint64_t n_valid = 0;      ///< samples that were used
  std::vector<WvLevel> levels;    ///< level 1 first; only levels with at least one coefficient
  std::vector<Segment> segments;  ///< runs of valid samples; empty when not known (streaming)
  double efficiency = 1.0;        ///< of the estimator relative to the classical one; 1 = classical
};

/// Robust estimation: Tukey-biweight M-estimator of the coefficients' scale (Mondal and Percival 2010;
/// Guerrier et al. 2014), largest root of its estimating equation.
struct RobustOptions {
  double efficiency = 0.6;  ///< on Gaussian coefficients, relative to the classical estimator; (0.2, 0.99)
  /// Tuning constant to use instead of the one that has that efficiency, for comparison with other software.
  std::optional<double> tuning_constant;
};

/// Which samples are used, how many levels, and by which estimator: the classical one unless `robust` is set.
struct WvOptions {
  int levels = 0;  ///< 0: as many as have a coefficient
  std::optional<RobustOptions> robust;
  /// One entry a sample, non-zero = valid; zero is a missing sample or one of another regime. Empty: all
  /// valid.
  std::span<const std::uint8_t> mask;
  bool nan_is_gap =
      false;  ///< otherwise a NaN or infinity in a valid sample is an error that names its place
  double confidence = 0.95;
};

/// Errors (kWork): fewer than 2 samples in every run; a value that is not finite; a mask of another length;
/// more levels asked for than the data allow. A constant signal is not an error: its levels are all zero.
/// Memory beyond the input: one copy of the signal (two when robust or with missing samples). Thread-safe.
Result<WaveletVariance> haar_wavelet_variance(std::span<const double> x, const WvOptions& options = {});

/// The same to the bit, without the copy where it is classical: `x` is used up.
Result<WaveletVariance> haar_wavelet_variance_in_place(std::span<double> x, const WvOptions& options = {});

/// Runs of non-zero mask entries that do not hold a non-finite value.
std::vector<Segment> valid_segments(std::span<const double> x, std::span<const std::uint8_t> mask);

/// Takes out of each level what missing samples add to its squares (G-33).
/// @param excess  mean over the level's coefficients of missing_excess()
void take_out_missing(std::vector<WvLevel>& levels, std::span<const MissingExcess> excess,
                      const HoleLengths& holes);

/// The interval [eta wv / chi2_{1-alpha/2}(eta), eta wv / chi2_{alpha/2}(eta)], eta = max(M_j / 2^j, 1).
/// `efficiency` below 1 widens it by 1/sqrt(efficiency) around the value.
void set_intervals(std::vector<WvLevel>& levels, double efficiency, double confidence);

}  // namespace imuscope::noise
