#include "simulated_noise.h"

#include <cmath>
#include <cstdlib>

namespace imuscope {
namespace {

using noise::Component;
using noise::ProcessKind;

void add_component(const Component& c, std::mt19937_64& random, std::vector<double>& x) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  const double sd = std::sqrt(c.amplitude);
  double state = 0.0;
  switch (c.kind) {
    case ProcessKind::kWhiteNoise:
      for (double& v : x) v += sd * normal(random);
      break;
    case ProcessKind::kRandomWalk:
      for (double& v : x) v += state += sd * normal(random);
      break;
    case ProcessKind::kGaussMarkov: {
      const double phi = std::exp(-c.shape[0]);
      const double drive = sd * std::sqrt(-std::expm1(-2.0 * c.shape[0]));
      state = sd * normal(random);
      for (double& v : x) {
        v += state;
        state = phi * state + drive * normal(random);
      }
      break;
    }
    case ProcessKind::kQuantization: {
      const double scale = std::sqrt(12.0) * sd;
      state = uniform(random);
      for (double& v : x) {
        const double next = uniform(random);
        v += scale * (next - state);
        state = next;
      }
      break;
    }
    default:
      std::abort();
  }
}

}  // namespace

std::vector<double> simulated_noise(const noise::Model& model, std::size_t n, std::mt19937_64& random) {
  std::vector<double> x(n, 0.0);
  for (const Component& c : model.components) add_component(c, random, x);
  return x;
}

}  // namespace imuscope
