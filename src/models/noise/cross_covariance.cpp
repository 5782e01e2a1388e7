#include "models/noise/cross_covariance.h"

#include <algorithm>
#include <cmath>

#include "models/noise/power_law.h"

namespace imuscope::noise {
namespace {

// G-37: the same with a complex rate
Oscillation oscillation_of(const Component& c) {
  const Complex rate(c.shape[0], -c.shape[1]);
  const Complex variance = c.amplitude * Complex(1.0, -c.shape[0] / c.shape[1]);
  const Complex sh = std::sinh(0.5 * rate);
  return {rate, variance, 0.25 / (sh * sh), (variance * 0.5 / std::tanh(0.5 * rate)).real()};
}

Exponential exponential_of_phi(double phi, double variance) {
  if (phi > 0.0) return exponential_of_rate(-std::log(phi), variance);
  Exponential e;
  e.a = -1.0;
  e.variance = variance;
  e.phi = phi;
  e.gain = phi / ((1.0 - phi) * (1.0 - phi));
  e.linear = 0.5 * (1.0 + phi) / (1.0 - phi);
  return e;
}

}  // namespace

// G-9: an exponential's coefficients without cancellation
Exponential exponential_of_rate(double a, double variance) {
  Exponential e;
  e.a = a;
  e.variance = variance;
  e.phi = std::exp(-a);
  const double sh = std::sinh(0.5 * a);
  e.gain = 0.25 / (sh * sh);
  e.linear = 0.5 / std::tanh(0.5 * a);
  constexpr double kSeriesBelow = 0.05;
  e.rest = a < kSeriesBelow ? -a / 6.0 * (1.0 - a * a / 60.0) : a * e.gain - e.linear;
  return e;
}

// G-9: G, sorted by its shape
Parts parts_of(const Model& model) {
  Parts parts;
  for (const Component& c : model.components) {
    if (c.amplitude <= 0.0) continue;
    const double theta = c.shape[0];
    switch (c.kind) {
      case ProcessKind::kWhiteNoise:
        parts.white += c.amplitude;
        break;
      case ProcessKind::kQuantization:
        parts.quantization += c.amplitude;
        parts.uniform += c.amplitude;
        break;
      case ProcessKind::kRandomWalk:
        parts.walk += c.amplitude;
        break;
      case ProcessKind::kRamp:
        parts.ramp += std::sqrt(c.amplitude);
        break;
      case ProcessKind::kGaussMarkov:
        parts.exponentials.push_back(exponential_of_rate(c.shape[0], c.amplitude));
        break;
      case ProcessKind::kMa1:  // white plus a quantization-like part, of either sign
        parts.white += c.amplitude * (1.0 + theta) * (1.0 + theta);
        parts.quantization -= c.amplitude * theta;
        break;
      case ProcessKind::kArma11: {
        const double phi = c.shape[0];
        const double ma = c.shape[1];
        constexpr double kNoMemory = 1e-6;
        if (std::abs(phi) < kNoMemory) {
          parts.white += c.amplitude * (1.0 + ma) * (1.0 + ma);
          parts.quantization -= c.amplitude * ma;
          break;
        }
        const double share = (ma + phi) * (1.0 + ma * phi) / (phi * (1.0 - phi * phi));
        parts.exponentials.push_back(exponential_of_phi(phi, c.amplitude * share));
        parts.white -= c.amplitude * ma / phi;
        break;
      }
      case ProcessKind::kSinusoid:
        parts.sinusoids.push_back(c);
        break;
      case ProcessKind::kResonance:
        parts.oscillations.push_back(oscillation_of(c));
        break;
      case ProcessKind::kFlicker:
      case ProcessKind::kPowerLaw:
        for (const Component& term : power_law_sum(c)) {
          if (term.kind == ProcessKind::kWhiteNoise) parts.white += term.amplitude;
          if (term.kind == ProcessKind::kRandomWalk) parts.walk += term.amplitude;
          if (term.kind != ProcessKind::kGaussMarkov) continue;
          parts.exponentials.push_back(exponential_of_rate(term.shape[0], term.amplitude));
          parts.exponentials.back().is_approximate = true;
        }
        break;
    }
  }
  return parts;
}

double rings_for(const Oscillation& o) {
  constexpr double kRinging = 4.0;  // time constants
  return kRinging / o.rate.real();
}

// G-39
double white_from(const Oscillation& o) {
  constexpr double kRung = 60.0;  // radians
  constexpr double kFaded = 8.0;  // time constants
  return std::max(kRung / std::abs(o.rate), kFaded / o.rate.real());
}

// G-9: break points, as distances from the centre of symmetry
std::vector<double> breaks_of(double n_j, double n_k) {
  std::vector<double> breaks;
  for (int a = 0; a < 3; ++a) {
    for (int b = 0; b < 3; ++b) breaks.push_back(std::abs(b * n_k - a * n_j - (n_k - n_j)));
  }
  std::sort(breaks.begin(), breaks.end());
  breaks.erase(std::unique(breaks.begin(), breaks.end()), breaks.end());
  return breaks;
}

// G-9: R
double exponential_remainder(double z) {
  constexpr double kSeriesBelow = 0.7;
  if (z >= kSeriesBelow) return std::expm1(-z) + z - 0.5 * z * z;
  double term = -z * z * z / 6.0;
  double sum = term;
  for (int k = 4; k < 18; ++k) {
    term *= -z / k;
    sum += term;
    if (std::abs(term) < 1e-17 * std::abs(sum)) break;
  }
  return sum;
}

}  // namespace imuscope::noise
