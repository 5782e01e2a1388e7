#include "batch/noise_bands.h"

#include <algorithm>

namespace imuscope::batch {

namespace {

/// The lowest frequencies hold what drifts; each is a band of its own.
constexpr Eigen::Index kSingleFrequencies = 4;
constexpr double kGrowth = 1.25;
constexpr Eigen::Index kLeastWidth = 2;
/// Degrees of freedom of the t-distribution that windows' powers are taken to have about the record's.
constexpr double kWindowDof = 10.0;
constexpr int kRounds = 6;
/// Nothing is quieter than this share of the loudest band: keeps weights finite on made-up records.
constexpr double kFloorShare = 1e-16;

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
    const Eigen::Matrix<std::complex<double>, Eigen::Dynamic, 6, Eigen::RowMajor>& residuals) {
  const Eigen::Index n_bands = bands.size();
  power_.setZero(n_bands, 6);
  window_power_.setZero(n_windows * n_bands, 6);
  for (Eigen::Index band = 0; band < n_bands; ++band) {
    // Real and imaginary part of each frequency; zero has no imaginary part.
    const double dof = 2.0 * static_cast<double>(bands.width(band)) - (bands.first(band) == 0 ? 1.0 : 0.0);
    for (Eigen::Index axis = 0; axis < 6; ++axis) {
      Eigen::VectorXd mean(n_windows);
      for (Eigen::Index w = 0; w < n_windows; ++w)
        mean[w] = residuals.col(axis)
                      .segment(w * n_frequencies + bands.first(band), bands.width(band))
                      .squaredNorm() /
                  static_cast<double>(bands.width(band));
      std::vector<double> sorted(mean.data(), mean.data() + mean.size());
      std::nth_element(sorted.begin(), sorted.begin() + n_windows / 2, sorted.end());
      double record = std::max(sorted[static_cast<std::size_t>(n_windows / 2)], 1e-30);
      Eigen::ArrayXd drawn;
      for (int round = 0; round < kRounds; ++round) {  // B-11
        drawn = (kWindowDof * record + dof * mean.array()) / (kWindowDof + dof);
        record = static_cast<double>(n_windows) / drawn.inverse().sum();
      }
      power_(band, axis) = record;
      for (Eigen::Index w = 0; w < n_windows; ++w) window_power_(w * n_bands + band, axis) = drawn[w];
    }
  }
  for (Eigen::Index axis = 0; axis < 6; ++axis) {
    const double floor = std::max(kFloorShare * power_.col(axis).maxCoeff(), 1e-30);
    power_.col(axis) = power_.col(axis).cwiseMax(floor);
    window_power_.col(axis) = window_power_.col(axis).cwiseMax(floor);
  }
}

}  // namespace imuscope::batch
