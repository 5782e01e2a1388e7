#include "noise/filter_form.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/contracts.h"
#include "noise/inference.h"

namespace imuscope::noise {
namespace {

/// Where a Gauss-Markov process of a correlation time of 1 sample is white to within a tenth.
constexpr double kWhiteBeyond = 20.0;
/// Share of the fitted curve below which a term that dies out with tau no longer matters.
constexpr double kNegligible = 0.1;

bool is_fast(const Component& c) {
  return c.kind == ProcessKind::kGaussMarkov && c.shape[0] * kFastSamples > 1.0;
}

bool has_short_memory(const Component& c) {
  return c.kind == ProcessKind::kQuantization || c.kind == ProcessKind::kMa1 ||
         c.kind == ProcessKind::kArma11 || c.kind == ProcessKind::kSinusoid;
}

/// The terms of `fit` that are not zero all find a place in `form`.
bool fits_into(const FitResult& fit, const ModelSpec& form) {
  ModelSpec used;
  for (const Component& c : fit.model.components) {
    if (c.amplitude <= 0.0) continue;
    if (is_fast(c)) return false;
    used.processes.push_back(c.kind);
  }
  return std::all_of(used.processes.begin(), used.processes.end(),
                     [&](ProcessKind kind) { return used.count(kind) <= form.count(kind); });
}

/// The first level at which every short term looks white or has died out.
int first_level(const FitResult& fit) {
  double tau = 0.0;
  for (const Component& c : fit.model.components) {
    if (c.amplitude <= 0.0) continue;
    if (is_fast(c)) tau = std::max(tau, kWhiteBeyond / c.shape[0]);
    if (!has_short_memory(c)) continue;
    for (const FittedLevel& level : fit.wv) {
      const double share = c.amplitude * unit_wv(c.kind, c.shape, level.observed.level).value / level.fitted;
      if (share > kNegligible) tau = std::max(tau, 2.0 * level.observed.tau_samples);
    }
  }
  return tau > 2.0 ? static_cast<int>(std::ceil(std::log2(tau))) : 1;
}

/// The same fit with another unit of the signal.
FitResult scaled(FitResult fit, double factor) {
  const double square = factor * factor;
  for (Component& c : fit.model.components) c.amplitude *= square;
  for (FittedLevel& level : fit.wv) {
    for (double* v : {&level.observed.value, &level.observed.ci_low, &level.observed.ci_high, &level.fitted,
                      &level.model_ci_low, &level.model_ci_high}) {
      *v *= square;
    }
  }
  for (ParameterEstimate& p : fit.parameters) {
    const bool is_root = p.name == "omega" || p.name == "alpha";
    const bool is_shape = p.name == "beta" || p.name == "frequency" || p.name == "theta" || p.name == "phi";
    const double by = is_shape ? 1.0 : is_root ? factor : square;
    p.value *= by;
    for (auto* v : {&p.sd, &p.ci_low, &p.ci_high}) {
      if (*v) **v *= by;
    }
  }
  return fit;
}

/// Mean wavelet variance of the sources in SI units, weighted by coefficients.
WaveletVariance mean_wv(const std::vector<FormSource>& sources) {
  WaveletVariance out;
  for (const FormSource& source : sources) {
    const double square = si_factor(source.unit) * si_factor(source.unit);
    out.n_samples = out.n_valid += source.fit->n;
    out.efficiency = std::min(out.efficiency, source.fit->efficiency);
    for (std::size_t i = 0; i < source.fit->wv.size(); ++i) {
      WvLevel from = source.fit->wv[i].observed;
      from.value *= square;
      if (i == out.levels.size()) {
        out.levels.push_back(from);
        continue;
      }
      WvLevel& to = out.levels[i];
      const auto count = static_cast<double>(to.n_coefficients);
      const auto more = static_cast<double>(from.n_coefficients);
      to.value = (count * to.value + more * from.value) / (count + more);
      to.n_coefficients += from.n_coefficients;
    }
  }
  constexpr double kConfidence = 0.95;
  set_intervals(out.levels, out.efficiency, kConfidence);
  return out;
}

/// Fits the form to the levels from `from` on, and from higher ones for as long as it takes something short
/// for a bias. `from` becomes the level that it was. As many levels stay as the form needs.
Result<FitResult> fit_from_level(WaveletVariance wv, const ModelSpec& form, double rate_hz, int& from) {
  const int highest = static_cast<int>(wv.levels.size()) - form.parameter_count();
  while (true) {
    from = std::min(from, highest);
    std::erase_if(wv.levels, [&](const WvLevel& level) { return level.level < from; });
    auto fitted = fit(wv, form, rate_hz);
    if (!fitted) return fitted;
    const auto& components = fitted->model.components;
    const bool short_bias = std::any_of(components.begin(), components.end(),
                                        [](const Component& c) { return c.amplitude > 0.0 && is_fast(c); });
    if (!short_bias || from == highest) return fitted;
    from = std::max(from + 1, first_level(*fitted));
  }
}

}  // namespace

Result<FormFit> fit_of_form(const std::vector<FormSource>& sources, const ModelSpec& form) {
  IMUSCOPE_EXPECTS(!sources.empty());
  const FitResult& first = *sources.front().fit;
  if (sources.size() == 1 && fits_into(first, form)) {
    return FormFit{scaled(first, si_factor(sources.front().unit)), first.spec.name() + " as fitted"};
  }
  for (const FormSource& source : sources) {
    if (source.fit->rate_hz != first.rate_hz) {
      return usage_error(
          fmt::format("the axes have different rates ({} and {} Hz)", first.rate_hz, source.fit->rate_hz),
          "export them one by one");
    }
  }
  int from = 1;
  for (const FormSource& source : sources) from = std::max(from, first_level(*source.fit));
  auto refitted = fit_from_level(mean_wv(sources), form, first.rate_hz, from);
  if (!refitted) return tl::unexpected(refitted.error());
  std::string origin = fmt::format("{} fitted to the wavelet variance", form.name());
  origin += sources.size() > 1 ? fmt::format(" of {} axes together", sources.size())
                               : fmt::format(" in place of {}", first.spec.name());
  if (from > 1) origin += fmt::format(" from tau = {:.3g} s on", std::ldexp(1.0, from) / first.rate_hz);
  if (refitted->j_test) origin += fmt::format(", J-test p = {:.2g}", refitted->j_test->p_value);
  return FormFit{std::move(*refitted), std::move(origin)};
}

double FilterTerms::low_frequency_density(const GaussMarkov& process) const {
  return process.variance / rate_hz / std::tanh(0.5 * process.rate_per_s / rate_hz);
}

FilterTerms::GaussMarkov FilterTerms::bias() const {
  GaussMarkov slowest;
  for (const GaussMarkov& process : gauss_markov) {
    if (process.variance > 0.0) slowest = process;
  }
  return slowest;
}

FilterTerms filter_terms(const FitResult& fit) {
  FilterTerms terms;
  terms.rate_hz = fit.rate_hz;
  const auto places = parameter_places(fit.model);
  // A record can be too short for a slow process and yet tell the white noise well.
  const auto is_determined = [&](std::size_t component) {
    for (std::size_t i = 0; i < places.size() && i < fit.parameters.size(); ++i) {
      if (places[i].component != component) continue;
      const ParameterEstimate& p = fit.parameters[i];
      const bool told = fit.identifiable || (p.ci_low && std::isfinite(*p.ci_low));
      if (!told || !std::isfinite(p.value) || p.value <= 0.0) return false;
    }
    return true;
  };
  for (std::size_t i = 0; i < fit.model.components.size(); ++i) {
    const Component& c = fit.model.components[i];
    switch (c.kind) {
      case ProcessKind::kWhiteNoise:
        terms.white_variance = c.amplitude;
        terms.white_is_determined = is_determined(i);
        break;
      case ProcessKind::kRandomWalk:
        terms.walk_density = c.amplitude * fit.rate_hz;
        break;
      case ProcessKind::kGaussMarkov:
        terms.gauss_markov.push_back({c.amplitude, c.shape[0] * fit.rate_hz, is_determined(i)});
        break;
      case ProcessKind::kMa1:
        terms.short_memory_density += c.amplitude * std::pow(1.0 + c.shape[0], 2) / fit.rate_hz;
        break;
      case ProcessKind::kArma11:
        terms.short_memory_density +=
            c.amplitude * std::pow((1.0 + c.shape[1]) / (1.0 - c.shape[0]), 2) / fit.rate_hz;
        break;
      case ProcessKind::kQuantization:
      case ProcessKind::kSinusoid:
      case ProcessKind::kRamp:
        break;
    }
  }
  return terms;
}

}  // namespace imuscope::noise
