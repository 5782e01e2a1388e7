#pragma once

/// What a filter feels of a noise model: from a fit the few numbers of a filter's configuration, whether they are
/// exported, printed as data-sheet rows or shown in a report (G-28 to G-32 in EQUATIONS.md). The terms one by one, for a
/// filter that takes each, are in filter_form.h.
///
/// A filter works in a band of times, from the shortest over which it integrates to the longest over which it
/// has to know how its biases grow. In that band a process is white (white noise, and a moving average, a
/// resonance or a Gauss-Markov process of a short memory with its density at frequency zero) or slow (the
/// rest); a Gauss-Markov process of about the band's first time is so in part, so that the numbers do not
/// jump where a fitted correlation time crosses it. Slow terms stand as they are where the filter's form has
/// them; else they are replaced by the form's own term that grows alike over the band.

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "models/noise/filter_form.h"
#include "models/noise/fit.h"

namespace imuscope::noise {

/// Times between which a filter works.
struct FilterBand {
  double from_s = kFastTau_s;
  double to_s = 100.0;
};

/// How well the data tell a number.
enum class Knowledge : std::uint8_t {
  kFitted,   ///< the value is an estimate
  kBound,    ///< the data give no value: what stands there is the most that they allow
  kUnknown,  ///< they do not even bound it
};

/// "fitted", "bound", "unknown".
const char* knowledge_name(Knowledge knowledge) noexcept;

/// A variance or a density, in the units of the signal.
struct Felt {
  double value = 0.0;
  double upper = 0.0;  ///< upper end of the interval at the fit's confidence; of a bound the bound
  double lower = 0.0;  ///< lower end; 0 of a bound
  Knowledge knowledge = Knowledge::kUnknown;
};

/// A Gauss-Markov process in the place of all slow terms.
struct FeltBias {
  Felt variance;
  double tau_s = 0.0;
  std::optional<double> tau_log_sd{};  ///< where the correlation time is the fit's own
  bool as_fitted = false;              ///< the model's own process, not one in its place
};

/// Density of what of a model is white in the band, unit^2/Hz: G-28.
double white_density(const Model& model, double rate_hz, const FilterBand& band);

/// The same as the fit tells it.
Felt felt_white_density(const FitResult& fit, const FilterBand& band);

/// Density that drives a random walk in the place of the slow terms, unit^2 Hz.
Felt felt_walk_density(const FitResult& fit, const FilterBand& band);

/// Both, for a form of white noise and a random walk, in less time than one after the other.
struct FeltWithWalk {
  Felt white_density;
  Felt walk_density;
};
FeltWithWalk felt_with_walk(const FitResult& fit, const FilterBand& band);

/// For a form of white noise and one Gauss-Markov process: the density of the white noise, and the process.
/// The slowest process is the bias, and no part of it white, even where it is faster than the band, as long
/// as it lasts ten samples.
struct FeltWithBias {
  Felt white_density;
  FeltBias bias;
};
FeltWithBias felt_with_bias(const FitResult& fit, const FilterBand& band);
/// The same with a given correlation time, for filters that have one for several axes.
FeltWithBias felt_with_bias(const FitResult& fit, const FilterBand& band, double tau_s);
/// The white density of that form alone.
Felt felt_white_beside_bias(const FitResult& fit, const FilterBand& band);

/// The correlation time of that process alone, which is quick to find.
struct BiasTime {
  double tau_s = 0.0;
  std::optional<double> tau_log_sd{};  ///< where it is the fit's own
};
BiasTime felt_bias_time(const FitResult& fit, const FilterBand& band);

/// Sd of the logarithm of a positive function of the model, whether or not each parameter is told (G-32).
/// Empty where the data do not tell the function.
std::optional<double> told_log_sd(const FitResult& fit, const std::function<double(const Model&)>& function);

/// Amplitude of one component of the model as it stands, in sample terms.
Felt felt_amplitude(const FitResult& fit, std::size_t component);

/// The slow terms that a fit has.
struct SlowTerms {
  std::string names;  ///< "GM2+RW"; empty without any
  std::vector<ProcessKind> kinds;

  /// One term alone, and it is of this kind.
  [[nodiscard]] bool are_just(ProcessKind kind) const { return kinds.size() == 1 && kinds.front() == kind; }
};
SlowTerms slow_terms(const FitResult& fit, const FilterBand& band);

/// A model that states that it misses every level by this much tells no filter how strong its noise is.
inline constexpr double kMostModelError = 1.0;

/// A level of the band that the model misses by more than it states: by more than twice the level's own
/// interval and the model error that the fit reports; or that error, where it is kMostModelError and more.
/// Empty where there is none; else a clause for people.
std::string missed_level(const FitResult& fit, const FilterBand& band);

}  // namespace imuscope::noise
