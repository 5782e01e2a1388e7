#include "models/noise/filter_form.h"

#include <algorithm>
#include <cmath>
#include <complex>

#include "models/noise/inference.h"
#include "models/noise/power_law.h"

namespace imuscope::noise {
// G-28: each process at low frequencies, f times its density
double low_frequency_variance(const Component& component) noexcept {
  const Shape& shape = component.shape;
  switch (component.kind) {
    case ProcessKind::kWhiteNoise:
      return component.amplitude;
    case ProcessKind::kGaussMarkov:  // (1 + phi) / (1 - phi)
      return component.amplitude / std::tanh(0.5 * shape[0]);
    case ProcessKind::kMa1:
      return component.amplitude * std::pow(1.0 + shape[0], 2);
    case ProcessKind::kArma11:
      return component.amplitude * std::pow((1.0 + shape[1]) / (1.0 - shape[0]), 2);
    case ProcessKind::kResonance: {  // Re[(1 - i a/b) (1 + z) / (1 - z)], G-37
      const std::complex<double> z = std::exp(std::complex<double>(-shape[0], shape[1]));
      const std::complex<double> weight(1.0, -shape[0] / shape[1]);
      return component.amplitude * (weight * (1.0 + z) / (1.0 - z)).real();
    }
    default:
      return 0.0;
  }
}

double FilterTerms::low_frequency_density(const GaussMarkov& process) const {
  const Component component{ProcessKind::kGaussMarkov, process.variance, {process.rate_per_s / rate_hz, 0.0}};
  return low_frequency_variance(component) / rate_hz;
}

FilterTerms::GaussMarkov FilterTerms::bias() const {
  GaussMarkov slowest;
  for (const GaussMarkov& process : gauss_markov) {
    if (process.variance > 0.0) slowest = process;
  }
  return slowest;
}

namespace {

/// The terms of the sum that a power law is to a filter. What of it is white counts as short memory.
void add_power_law(FilterTerms& terms, const Component& power_law, bool is_determined) {
  for (const Component& c : power_law_sum(power_law)) {
    if (c.kind == ProcessKind::kWhiteNoise) {
      terms.short_memory_density += c.amplitude / terms.rate_hz;
    } else if (c.kind == ProcessKind::kRandomWalk) {
      terms.walk_density += c.amplitude * terms.rate_hz;
    } else {
      terms.gauss_markov.push_back({c.amplitude, c.shape[0] * terms.rate_hz, is_determined});
    }
  }
}

}  // namespace

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
      case ProcessKind::kFlicker:
      case ProcessKind::kPowerLaw:
        add_power_law(terms, c, is_determined(i));
        break;
      case ProcessKind::kResonance:
      case ProcessKind::kMa1:
      case ProcessKind::kArma11:
        terms.short_memory_density += low_frequency_variance(c) / fit.rate_hz;
        break;
      case ProcessKind::kQuantization:
      case ProcessKind::kSinusoid:
      case ProcessKind::kRamp:
        break;
    }
  }
  std::stable_sort(terms.gauss_markov.begin(), terms.gauss_markov.end(),
                   [](const auto& a, const auto& b) { return a.rate_per_s > b.rate_per_s; });
  return terms;
}

}  // namespace imuscope::noise
