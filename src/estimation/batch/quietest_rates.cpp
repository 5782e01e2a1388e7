#include "estimation/batch/quietest_rates.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "estimation/batch/grid.h"

namespace imuscope::batch {
namespace {

/// Power of the reference's rates in each window (row) and band (column) from 1 to 10 Hz, mean over axes, by the lower
/// and the upper half of the band's frequencies. One between them is left out: neighbours share what the window's
/// ends spread.
struct HalvesOfRates {
  Eigen::ArrayXXd chooses;
  Eigen::ArrayXXd reads;
};
HalvesOfRates halves_of_rates(const Problem& problem) {
  constexpr double kFrom_hz = 1.0;
  constexpr double kTo_hz = 10.0;
  constexpr Eigen::Index kFewestFrequencies = 8;  // each half has three at least
  std::vector<Eigen::Index> bands;
  for (Eigen::Index band = 0; band < problem.bands.size(); ++band) {
    if (problem.plan.frequency_hz(problem.bands.first(band)) >= kFrom_hz &&
        problem.plan.frequency_hz(problem.bands.end(band)) <= kTo_hz &&
        problem.bands.width(band) >= kFewestFrequencies)
      bands.push_back(band);
  }
  const auto n_windows = static_cast<Eigen::Index>(problem.plan.starts.size());
  const auto n_bands = static_cast<Eigen::Index>(bands.size());
  HalvesOfRates halves{Eigen::ArrayXXd::Zero(n_windows, n_bands), Eigen::ArrayXXd::Zero(n_windows, n_bands)};
  for (Eigen::Index i = 0; i < n_bands; ++i) {
    const Eigen::Index first = problem.bands.first(bands[static_cast<std::size_t>(i)]);
    const Eigen::Index width = problem.bands.width(bands[static_cast<std::size_t>(i)]);
    const Eigen::Index n_choosing = width / 2;
    for (Eigen::Index w = 0; w < n_windows; ++w) {
      for (Eigen::Index k = 0; k < width; ++k) {
        if (k == n_choosing) continue;
        (k < n_choosing ? halves.chooses : halves.reads)(w, i) +=
            kWindowsPerInstant * problem.reference.row(w, first + k).segment<3>(kOmega).squaredNorm() / 3.0;
      }
    }
    halves.chooses.col(i) /= static_cast<double>(n_choosing);
    halves.reads.col(i) /= static_cast<double>(width - n_choosing - 1);
  }
  return halves;
}

}  // namespace

// B-21a: N
double quietest_gyro_white_radps_per_sqrt_hz(const Problem& problem) {
  constexpr std::size_t kQuietest = 20;
  const HalvesOfRates halves = halves_of_rates(problem);
  if (halves.reads.cols() == 0) return std::numeric_limits<double>::infinity();
  const Eigen::ArrayXd least = halves.chooses.rowwise().minCoeff();
  std::vector<Eigen::Index> windows(static_cast<std::size_t>(least.size()));
  std::iota(windows.begin(), windows.end(), Eigen::Index{0});
  const std::size_t n = windows.size() / kQuietest + 1;
  std::ranges::nth_element(windows, windows.begin() + static_cast<std::ptrdiff_t>(n - 1), {},
                           [&](Eigen::Index w) { return least[w]; });
  windows.resize(n);
  Eigen::Index band = 0;
  halves.chooses(windows, Eigen::all).colwise().sum().minCoeff(&band);
  return std::sqrt(halves.reads(windows, band).mean() / kGridRate_hz);
}

}  // namespace imuscope::batch
