#pragma once

/// Series of known content.

#include <cmath>
#include <cstddef>
#include <random>
#include <vector>

namespace imuscope::noise::test {

/// Independent, of unit variance.
inline std::vector<double> white(std::size_t n, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<double> x(n);
  for (double& v : x) v = normal(random);
  return x;
}

inline double relative(double value, double expected) {
  return std::abs(value - expected) / std::abs(expected);
}

}  // namespace imuscope::noise::test
