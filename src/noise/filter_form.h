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

/// What filters are made of, in SI units and continuous time; zero where the model has no such term.
struct FilterTerms {
  double white_density = 0.0;  ///< unit^2/Hz
  double walk_density = 0.0;   ///< unit^2 Hz, of the random walk
  double bias_variance = 0.0;  ///< of the Gauss-Markov process
  double bias_rate = 0.0;      ///< its beta, 1/s
};
FilterTerms filter_terms(const FitResult& si_fit);

}  // namespace imuscope::noise
