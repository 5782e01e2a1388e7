#pragma once

/// Wavelet variances and fits as JSON: the fields of `wv --json`, `fit --json` and the entries of
/// models.json. What is not known is null.

#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "base/result.h"
#include "models/noise/fit.h"
#include "models/noise/lines.h"
#include "models/noise/quantities.h"
#include "models/noise/select.h"

namespace imuscope::noise {

/// {"n", "rate_hz", "wv": [{"level", "tau_s", "value", "ci_low", "ci_high", "n_coefficients"}]};
/// a robust one has "efficiency" and "rejected_share" too.
nlohmann::json wv_to_json(const WaveletVariance& wv, double rate_hz);

/// {"n", "rate_hz", "fitted_to": {"seconds", "stretches"}, "model", "weights", "intervals": "quick" or
/// "inverted", "confidence", "wv": [.. and "fitted", "model_ci_low", "model_ci_high"],
///  "parameters": [{"process", "name", "unit", "value", "sd", "ci_low", "ci_high", and "spread_sd" where
///  parts of the record differ}], "covariance" (row-major, of the logarithms), "objective", "model_error",
///  "j_test", "criterion", "identifiable", "simpler_model", "warnings"}.
nlohmann::json fit_to_json(const FitResult& fit);

/// fit_to_json() and the fields "unit" and "quantities".
nlohmann::json fit_to_json(const FitResult& fit, SignalUnit unit);

/// [{"model", "criterion", "identifiable", "p_value", "reason"}], best first.
nlohmann::json ranking_to_json(const std::vector<RankedModel>& ranked);

/// [{"process", "name", "unit", "value", "ci_low", "ci_high", "known": "fitted", "bound" or "unknown"}].
nlohmann::json quantities_to_json(const std::vector<Quantity>& quantities);

/// [{"process": "SIN1", "parameters": [alpha, frequency: {"name", "unit", "value", "sd", "ci_low",
/// "ci_high"}], "wv": what it adds to each level}].
/// @param fit   of what the lines left: rate, levels, confidence
/// @param unit  of the signal
nlohmann::json sinusoids_to_json(const std::vector<Line>& lines, const FitResult& fit,
                                 const std::string& unit);

/// What an entry was fitted to, for people: "812 s of regime static in 9 stretches, between 3.0 s and 1805.2
/// s of the run, without lines at 21.3 Hz". Empty where the entry does not say.
std::string fitted_to_words(const nlohmann::json& entry);

/// Values of a process by the names under which they are printed: {"sigma2": 1e-6, "beta": 0.01}.
using ProcessValues = std::map<std::string, double>;

/// A model from the values of its processes, in the terms of ParameterEstimate.
/// @param values  by the names of component_names(): "WN", "GM1", ...
/// Errors (kUsage): a rate that is none; a process or value that is missing, unknown, or out of its range,
/// named.
Result<Model> model_from_values(const ModelSpec& spec, double rate_hz,
                                const std::map<std::string, ProcessValues>& values);

/// Reads what fit_to_json() wrote. Errors (kWork): the field that is missing or of the wrong type.
Result<FitResult> fit_from_json(const nlohmann::json& json);

}  // namespace imuscope::noise
