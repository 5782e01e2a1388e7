#include "estimation/batch/noise_bands.h"

#include <algorithm>
#include <cmath>

namespace imuscope::batch {

namespace {

/// The lowest frequencies hold what drifts; each is a band of its own.
constexpr Eigen::Index kSingleFrequencies = 4;
constexpr double kGrowth = 1.25;
constexpr Eigen::Index kLeastWidth = 2;
/// Degrees of freedom of the t-distribution that windows' powers are taken to have about the record's.
constexpr double kWindowDof = 10.0;
constexpr int kRounds = 6;
/// Share of a band's numbers that the parameters leave at least.
constexpr double kLeastLeft = 0.3;
/// Nothing is quieter than this share of the loudest band: keeps weights finite on made-up records.
constexpr double kFloorShare = 1e-16;

/// B-11a: by how much weights of this kind claim more than they know, where the noise is normal: weights that
/// follow the residuals take the smaller ones for the better known.
double claim(double dof) {
  constexpr int kSteps = 400;
  constexpr double kReach = 8.0;  // sd of the logarithm's spread to either side
  std::vector<double> x;
  std::vector<double> weight;
  const double width = kReach * std::sqrt(2.0 / dof);
  double total = 0.0;
  for (int i = 0; i <= kSteps; ++i) {
    const double log_x = std::log(dof) + width * (2.0 * i / kSteps - 1.0);
    x.push_back(std::exp(log_x));
    // Density of chi-squared on the logarithm's scale.
    weight.push_back(std::exp(0.5 * dof * (log_x - std::log(dof)) - 0.5 * (x.back() - dof)));
    total += weight.back();
  }
  const auto mean = [&](auto of) {
    double sum = 0.0;
    for (std::size_t i = 0; i < x.size(); ++i) sum += weight[i] * of(x[i]);
    return sum / total;
  };
  double record = 1.0;
  const auto drawn = [&](double x_i) { return (kWindowDof * record + x_i) / (kWindowDof + dof); };
  constexpr int kSettling = 50;
  for (int round = 0; round < kSettling; ++round)
    record = 1.0 / mean([&](double x_i) { return 1.0 / drawn(x_i); });
  const double slope = mean([&](double x_i) {
    const double t = drawn(x_i);
    return 1.0 / t - 2.0 * x_i / (dof * (kWindowDof + dof) * t * t);
  });
  const double scatter = mean([&](double x_i) { return x_i / dof / (drawn(x_i) * drawn(x_i)); });
  return scatter / (slope * slope * record);
}

}  // namespace

Bands::Bands(Eigen::Index n_frequencies) {
  for (Eigen::Index k = 1; k <= std::min(kSingleFrequencies, n_frequencies); ++k) edges_.push_back(k);
  while (edges_.back() < n_frequencies) {
    const auto next = static_cast<Eigen::Index>(static_cast<double>(edges_.back()) * kGrowth);
    edges_.push_back(std::min(std::max(next, edges_.back() + kLeastWidth), n_frequencies));
  }
}

NoiseBands::NoiseBands(
    const Bands& bands, Eigen::Index n_windows, Eigen::Index n_frequencies,
    const Eigen::Matrix<std::complex<double>, Eigen::Dynamic, 6, Eigen::RowMajor>& residuals,
    const Eigen::MatrixX2d& taken) {
  const Eigen::Index n_bands = bands.size();
  power_.setZero(n_bands, 6);
  window_power_.setZero(n_windows * n_bands, 6);
  claimed_.resize(n_bands);
  for (Eigen::Index band = 0; band < n_bands; ++band) {
    // Real and imaginary part of each frequency; zero has no imaginary part.
    const double dof = 2.0 * static_cast<double>(bands.width(band)) - (bands.first(band) == 0 ? 1.0 : 0.0);
    const double claimed = claim(dof);
    claimed_[band] = claimed;
    const double numbers = 3.0 * dof * static_cast<double>(n_windows) / kWindowsPerInstant;
    for (Eigen::Index axis = 0; axis < 6; ++axis) {
      // B-11b
      const double left = std::max(1.0 - taken(band, axis / 3) / numbers, kLeastLeft);
      Eigen::VectorXd mean(n_windows);
      // B-10: T of each window
      for (Eigen::Index w = 0; w < n_windows; ++w)
        mean[w] = residuals.col(axis)
                      .segment(w * n_frequencies + bands.first(band), bands.width(band))
                      .squaredNorm() *
                  kWindowsPerInstant / static_cast<double>(bands.width(band));
      std::vector<double> sorted(mean.data(), mean.data() + mean.size());
      std::nth_element(sorted.begin(), sorted.begin() + n_windows / 2, sorted.end());
      double record = std::max(sorted[static_cast<std::size_t>(n_windows / 2)], 1e-30);
      Eigen::ArrayXd drawn;
      for (int round = 0; round < kRounds; ++round) {  // B-11
        drawn = (kWindowDof * record + dof * mean.array()) / (kWindowDof + dof);
        record = static_cast<double>(n_windows) / drawn.inverse().sum();
      }
      power_(band, axis) = claimed / left * record;
      for (Eigen::Index w = 0; w < n_windows; ++w)
        window_power_(w * n_bands + band, axis) = claimed / left * drawn[w];
    }
  }
  for (Eigen::Index axis = 0; axis < 6; ++axis) {
    const double floor = std::max(kFloorShare * power_.col(axis).maxCoeff(), 1e-30);
    power_.col(axis) = power_.col(axis).cwiseMax(floor);
    window_power_.col(axis) = window_power_.col(axis).cwiseMax(floor);
  }
}

}  // namespace imuscope::batch
