#pragma once

/// Records of simulated axes at rest.

#include <cmath>
#include <random>

#include "models/certificate/axis_certificate.h"

namespace imuscope::certificate::test {

/// White noise of this sd a sample and a random walk of this step, deg/s at 100 Hz.
inline AxisRecord made_gyro(std::size_t n, unsigned seed, double white_sd = 0.2, double walk_step = 0.0) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  AxisRecord record;
  record.name = "gyro_x";
  record.unit = noise::SignalUnit::kDegps;
  record.rate_hz = 100.0;
  double walk = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    walk += walk_step * normal(random);
    record.values.push_back(0.5 + walk + white_sd * normal(random));
  }
  return record;
}

inline const TermValue& term_of(const AxisCertificate& axis, Term wanted) {
  for (const TermValue& term : axis.terms) {
    if (term.term == wanted) return term;
  }
  std::abort();
}

}  // namespace imuscope::certificate::test
