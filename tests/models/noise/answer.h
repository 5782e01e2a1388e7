#pragma once

/// Lines of a recorded answer: wavelet variances, models and fits.

#include <fmt/format.h>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "models/noise/fit.h"
#include "models/noise/haar_levels.h"
#include "models/noise/model.h"
#include "models/noise/wavelet_variance.h"
#include "tests/support/answer.h"

namespace imuscope::noise::test {

using imuscope::test::Answer;

inline void add_places(Answer& answer, std::string_view what, const std::vector<Segment>& places) {
  if (places.empty()) return;
  std::string text;
  for (const Segment& place : places) text += fmt::format(" {}-{}", place.begin, place.end);
  answer.line(what, text);
}

inline void add_wv(Answer& answer, const WaveletVariance& wv) {
  answer.line("n", wv.n_samples, "valid", wv.n_valid, "efficiency", wv.efficiency);
  add_places(answer, "segments", wv.segments);
  for (const WvLevel& level : wv.levels) {
    answer.line(level.level, level.tau_samples, level.value, level.ci_low, level.ci_high,
                level.n_coefficients, level.rejected_share, level.inflation);
    add_places(answer, "places", level.places);
  }
}

inline void add_model(Answer& answer, const Model& model) {
  const auto names = component_names(model);
  for (std::size_t i = 0; i < names.size(); ++i)
    answer.line(names[i], model.components[i].amplitude, model.components[i].shape);
}

inline void add_j_test(Answer& answer, const std::optional<JTest>& test) {
  if (test)
    answer.line("j test", test->statistic, test->dof, test->p_value);
  else
    answer.line("no j test");
}

inline void add_parameters(Answer& answer, const FitResult& fit) {
  for (const ParameterEstimate& p : fit.parameters) {
    answer.line(p.process, p.name, '[' + p.unit + ']', p.value, p.sd, p.ci_low, p.ci_high, p.log_sd,
                p.spread_sd);
  }
}

/// What is said of a fit, but the observed wavelet variance.
inline void add_fit(Answer& answer, const FitResult& fit) {
  answer.line("fit", fit.spec.name(), fit.n, fit.stretches, fit.rate_hz, static_cast<int>(fit.weighting),
              static_cast<int>(fit.intervals), fit.confidence, fit.efficiency);
  answer.line("objective", fit.objective, "error", fit.model_error, "criterion", fit.criterion,
              fit.identifiable, fit.simpler_model);
  add_j_test(answer, fit.j_test);
  add_model(answer, fit.model);
  add_parameters(answer, fit);
  answer.line("covariance", fit.covariance);
  for (const FittedLevel& level : fit.wv)
    answer.line(level.observed.level, level.fitted, level.model_ci_low, level.model_ci_high);
  for (const std::string& warning : fit.warnings) answer.line(warning);
}

}  // namespace imuscope::noise::test
