#pragma once

/// The terms of a fit that a filter is made of.

#include <vector>

#include "models/noise/fit.h"

namespace imuscope::noise {

/// A process of at most this time constant acts like white noise on a filter that integrates for longer, a
/// slower one like a bias.
inline constexpr double kFastTau_s = 1.0;

/// Variance of the white noise that has the component's density at frequency zero, in sample terms (G-28);
/// zero for what has none there (quantization, sinusoids) or no end (random walk, ramp).
double low_frequency_variance(const Component& component) noexcept;

/// What filters are made of, in the fit's own units and continuous time. A term that the model does not have
/// is zero; quantization, ramps and sinusoids have nothing that a filter could take. A power law is the sum
/// of power_law.h.
struct FilterTerms {
  struct GaussMarkov {
    double variance = 0.0;
    double rate_per_s = 0.0;     ///< beta
    bool is_determined = false;  ///< both are positive, and the data tell them
    [[nodiscard]] double tau_s() const { return 1.0 / rate_per_s; }
    [[nodiscard]] bool is_fast() const { return rate_per_s * kFastTau_s >= 1.0; }
  };
  double rate_hz = 0.0;                     ///< of the samples
  double white_variance = 0.0;              ///< of a sample's white noise
  bool white_is_determined = false;         ///< it is positive, and the data tell it
  double short_memory_density = 0.0;        ///< MA1, ARMA11, RES at low frequencies, unit^2/Hz
  double walk_density = 0.0;                ///< unit^2 Hz, of the random walk
  std::vector<GaussMarkov> gauss_markov{};  ///< in order of falling rate; those of no variance, too

  [[nodiscard]] double white_density() const { return white_variance / rate_hz; }  ///< unit^2/Hz
  /// Of a sampled Gauss-Markov process at low frequencies (G-28), unit^2/Hz.
  [[nodiscard]] double low_frequency_density(const GaussMarkov& process) const;
  /// The slowest process that has a variance; zeros without one.
  [[nodiscard]] GaussMarkov bias() const;
};

/// Term by term, for what is given back to the estimator and judged in outages; felt_noise.h makes a tool's
/// few numbers of them.
FilterTerms filter_terms(const FitResult& fit);

}  // namespace imuscope::noise
