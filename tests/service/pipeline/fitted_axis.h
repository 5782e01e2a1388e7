#pragma once

/// What the modeller hands to the filter of one axis, made by hand.

#include <utility>

#include "service/pipeline/refit.h"

namespace imuscope::test {

/// White noise, a fast and a slow GM.
inline AxisRefit refit_of(std::size_t axis, Regime regime, double white_sd, double fast_sd, double fast_tau_s,
                          double slow_sd, double slow_tau_s) {
  using noise::ProcessKind;
  constexpr double kFitRate_hz = 100.0;
  noise::FitResult fit;
  fit.rate_hz = kFitRate_hz;
  const auto add = [&](ProcessKind kind, double sd, double tau_s) {
    fit.spec.processes.push_back(kind);
    fit.model.components.push_back({kind, sd * sd, {1.0 / (tau_s * kFitRate_hz)}});
    if (kind == ProcessKind::kGaussMarkov)
      fit.parameters.push_back({"GM", "beta", "", 1.0 / tau_s, {}, {}, {}, {}});
    fit.parameters.push_back({"", "sigma2", "", sd * sd, {}, {}, {}, {}});
  };
  add(ProcessKind::kWhiteNoise, white_sd, 1.0);
  add(ProcessKind::kGaussMarkov, fast_sd, fast_tau_s);
  add(ProcessKind::kGaussMarkov, slow_sd, slow_tau_s);
  AxisRefit refit;
  refit.axis = axis;
  refit.regime = regime;
  refit.fit = std::move(fit);
  return refit;
}

}  // namespace imuscope::test
