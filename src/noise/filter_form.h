#pragma once

/// Models cut down to what a filter's configuration can hold, in SI units.

#include <string>
#include <vector>

#include "base/result.h"
#include "noise/fit.h"
#include "noise/quantities.h"

namespace imuscope::noise {

inline constexpr double kFastSamples = 10.0;

/// A fit to be cut down and the unit of its signal; `fit` is the caller's and never null.
struct FormSource {
  SignalUnit unit = SignalUnit::kNone;
  const FitResult* fit = nullptr;
};

/// A fit of the form's terms in SI units, and how it came about.
struct FormFit {
  FitResult fit;
  std::string origin;  ///< one line
};

/// One source whose terms the form has all: the fit itself. Otherwise the form is fitted to the source's
/// wavelet variance, or to the mean one of several sources (axes of one triad). Errors: those of fit();
/// sources of different rates (kUsage).
Result<FormFit> fit_of_form(const std::vector<FormSource>& sources, const ModelSpec& form);

/// A process of at most this time constant acts like white noise on a filter that integrates for longer, a
/// slower one like a bias.
inline constexpr double kFastTau_s = 1.0;

/// What filters are made of, in the fit's own units and continuous time. A term that the model does not have
/// is zero; quantization, ramps and sinusoids have nothing that a filter could take.
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
  double short_memory_density = 0.0;        ///< MA1 and ARMA11 at low frequencies, unit^2/Hz
  double walk_density = 0.0;                ///< unit^2 Hz, of the random walk
  std::vector<GaussMarkov> gauss_markov{};  ///< in order of falling rate; those of no variance, too

  [[nodiscard]] double white_density() const { return white_variance / rate_hz; }  ///< unit^2/Hz
  /// Of a sampled Gauss-Markov process at low frequencies, unit^2/Hz: variance * period * (1 + phi) /
  /// (1 - phi).
  [[nodiscard]] double low_frequency_density(const GaussMarkov& process) const;
  /// The slowest process that has a variance; zeros without one.
  [[nodiscard]] GaussMarkov bias() const;
};

/// The only way from a fit to a filter: for what is exported, given back to the estimator and judged in
/// outages.
FilterTerms filter_terms(const FitResult& fit);

}  // namespace imuscope::noise
