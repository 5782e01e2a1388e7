#include "models/noise/covariance_corrections.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace imuscope::noise {
namespace {

/// |transfer function of level's coefficients|^2 at angular frequency b.
double gain_at(double b, double n) {
  const double ratio = std::sin(0.5 * n * b) / (n * std::sin(0.5 * b));
  return ratio * ratio * std::sin(0.5 * n * b) * std::sin(0.5 * n * b);
}

/// Spectrum sum_h gamma(h) exp(-i b h) of the parts that are stationary or become so by the wavelet.
double spectrum_at(const Parts& parts, double b) {
  const double s2 = 4.0 * std::sin(0.5 * b) * std::sin(0.5 * b);
  double sum = parts.white + parts.quantization * s2 + parts.walk / s2;
  for (const Exponential& e : parts.exponentials) {
    sum += e.variance * (1.0 - e.phi * e.phi) / ((1.0 - e.phi) * (1.0 - e.phi) + e.phi * s2);
  }
  for (const Oscillation& o : parts.oscillations) {
    const Complex z = std::exp(-o.rate);
    sum += (o.variance * (1.0 - z * z) / ((1.0 - z) * (1.0 - z) + z * s2)).real();
  }
  return sum;
}

constexpr double kLeastEigenvalue = 0.01;

}  // namespace

// G-44
double sinusoid_covariance(const Parts& parts, const WvLevel& j, const WvLevel& k) {
  double sum = 0.0;
  const auto count = static_cast<double>(std::max(j.n_coefficients, k.n_coefficients));
  for (const Component& s : parts.sinusoids) {
    const double b = s.shape[0];
    sum += 2.0 * s.amplitude * gain_at(b, 0.5 * j.tau_samples) * gain_at(b, 0.5 * k.tau_samples) *
           spectrum_at(parts, b) / count;
  }
  return sum;
}

// G-10
double uniform_correction(double q2, const std::vector<Segment>& runs, const WvLevel& j, const WvLevel& k) {
  constexpr double kExcessKurtosis = -1.2;
  const double n_j = 0.5 * j.tau_samples;
  const double n_k = 0.5 * k.tau_samples;
  const auto overlap_of_run = [&](double length) {
    const double m_j = length - 2.0 * n_j + 1.0;
    const double m_k = length - 2.0 * n_k + 1.0;
    if (m_j <= 0.0 || m_k <= 0.0) return 0.0;
    double sum = 0.0;
    for (std::size_t a = 0; a < 3; ++a) {
      for (std::size_t b = 0; b < 3; ++b) {
        const double weight = kDifference[a] * kDifference[a] * kDifference[b] * kDifference[b];
        const double end = -std::max(static_cast<double>(a) * n_j, static_cast<double>(b) * n_k);
        const double begin =
            -std::min(static_cast<double>(a) * n_j + m_j, static_cast<double>(b) * n_k + m_k);
        sum += weight * std::max(0.0, end - begin);
      }
    }
    return sum;
  };
  double sum = 0.0;
  for (const Segment& s : runs) sum += overlap_of_run(static_cast<double>(s.end - s.begin));
  const auto count_j = static_cast<double>(j.n_coefficients);
  const auto count_k = static_cast<double>(k.n_coefficients);
  if (runs.empty()) sum = overlap_of_run(std::min(count_j + 2.0 * n_j, count_k + 2.0 * n_k) - 1.0);
  const double scale = 1.0 / (16.0 * n_j * n_j * n_k * n_k);
  return kExcessKurtosis * q2 * q2 * scale * sum / (count_j * count_k);
}

// G-34
double white_of_missing(const WvLevel& j, const WvLevel& k) {
  const auto white_of = [](const WvLevel& level) {
    return (level.inflation - 1.0) * level.value * level.tau_samples;
  };
  return j.inflation > 1.0 && k.inflation > 1.0 ? std::sqrt(white_of(j) * white_of(k)) : 0.0;
}

Eigen::MatrixXd bounded_below(const Eigen::MatrixXd& v) {
  const Eigen::VectorXd sd = v.diagonal().cwiseSqrt();
  const Eigen::MatrixXd correlation = sd.cwiseInverse().asDiagonal() * v * sd.cwiseInverse().asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> of_correlation(correlation);
  if (!(of_correlation.eigenvalues().minCoeff() < kLeastEigenvalue)) return v;
  const Eigen::MatrixXd& axes = of_correlation.eigenvectors();
  const Eigen::MatrixXd lifted =
      axes * of_correlation.eigenvalues().cwiseMax(kLeastEigenvalue).asDiagonal() * axes.transpose();
  const Eigen::VectorXd scale = sd.cwiseQuotient(lifted.diagonal().cwiseSqrt());
  return scale.asDiagonal() * lifted * scale.asDiagonal();
}

}  // namespace imuscope::noise
