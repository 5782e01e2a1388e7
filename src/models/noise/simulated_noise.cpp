#include "models/noise/simulated_noise.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <unsupported/Eigen/FFT>
#include <unsupported/Eigen/MatrixFunctions>

namespace imuscope::noise {
namespace {

/// The sampled oscillator x'' + 2 a x' + (a^2 + b^2) x = w from its exact transition.
void add_resonance(const Component& c, std::mt19937_64& random, std::span<double> x) {
  std::normal_distribution<double> normal;
  const double a = c.shape[0];
  const double b = c.shape[1];
  Eigen::Matrix2d generator;
  generator << 0.0, 1.0, -(a * a + b * b), -2.0 * a;
  const Eigen::Matrix2d F = generator.exp();
  const Eigen::Matrix2d P = c.amplitude * Eigen::Vector2d(1.0, a * a + b * b).asDiagonal().toDenseMatrix();
  const Eigen::Matrix2d drive = Eigen::Matrix2d(P - F * P * F.transpose()).llt().matrixL();
  Eigen::Vector2d state =
      Eigen::Matrix2d(P.llt().matrixL()) * Eigen::Vector2d{normal(random), normal(random)};
  for (double& v : x) {
    v += state[0];
    state = F * state + drive * Eigen::Vector2d{normal(random), normal(random)};
  }
}

/// Gaussian noise of spectrum sd^2 |2 sin(pi f)|^-alpha. Of what repeats after two lengths one is used.
void add_power_law(double alpha, double sd, std::mt19937_64& random, std::span<double> x) {
  std::normal_distribution<double> normal;
  std::size_t n = 2;
  while (n < 2 * x.size()) n *= 2;
  std::vector<std::complex<double>> spectrum(n);
  for (std::size_t k = 1; k < n / 2; ++k) {
    const double f = static_cast<double>(k) / static_cast<double>(n);
    const double scale = sd * std::pow(2.0 * std::sin(std::numbers::pi * f), -0.5 * alpha) *
                         std::sqrt(0.5 * static_cast<double>(n));
    spectrum[k] = scale * std::complex<double>{normal(random), normal(random)};
    spectrum[n - k] = std::conj(spectrum[k]);
  }
  spectrum[n / 2] = sd * std::pow(2.0, -0.5 * alpha) * std::sqrt(static_cast<double>(n)) * normal(random);
  Eigen::FFT<double> fft;
  std::vector<std::complex<double>> made;
  fft.inv(made, spectrum);
  for (std::size_t i = 0; i < x.size(); ++i) x[i] += made[i].real();
}

/// y_k = phi y_{k-1} + e_k + theta e_{k-1}, from its stationary distribution.
void add_arma(double phi, double theta, double sd, std::mt19937_64& random, std::span<double> x) {
  std::normal_distribution<double> normal;
  double e = sd * normal(random);
  // Of y what e does not tell: its variance is sd^2 (theta + phi)^2 / (1 - phi^2).
  double y = e + sd * (theta + phi) / std::sqrt(1.0 - phi * phi) * normal(random);
  for (double& v : x) {
    v += y;
    const double next = sd * normal(random);
    y = phi * y + next + theta * e;
    e = next;
  }
}

void add_component(const Component& c, std::mt19937_64& random, std::span<double> x) {
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
    case ProcessKind::kRamp: {
      const double slope = uniform(random) < 0.5 ? -sd : sd;
      for (std::size_t i = 0; i < x.size(); ++i) x[i] += slope * static_cast<double>(i);
      break;
    }
    case ProcessKind::kResonance:
      add_resonance(c, random, x);
      break;
    case ProcessKind::kFlicker:
      add_power_law(1.0, sd, random, x);
      break;
    case ProcessKind::kPowerLaw:
      add_power_law(c.shape[0], sd, random, x);
      break;
    case ProcessKind::kSinusoid: {
      const double phase = 2.0 * std::numbers::pi * uniform(random);
      for (std::size_t i = 0; i < x.size(); ++i)
        x[i] += sd * std::sin(c.shape[0] * static_cast<double>(i) + phase);
      break;
    }
    case ProcessKind::kMa1:
      add_arma(0.0, c.shape[0], sd, random, x);
      break;
    case ProcessKind::kArma11:
      add_arma(c.shape[0], c.shape[1], sd, random, x);
      break;
  }
}

}  // namespace

void simulate_noise(const Model& model, std::mt19937_64& random, std::span<double> x) {
  std::fill(x.begin(), x.end(), 0.0);
  for (const Component& c : model.components) add_component(c, random, x);
}

std::vector<double> simulated_noise(const Model& model, std::size_t n, std::mt19937_64& random) {
  std::vector<double> x(n);
  simulate_noise(model, random, x);
  return x;
}

}  // namespace imuscope::noise
