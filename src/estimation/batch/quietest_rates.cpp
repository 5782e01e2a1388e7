#include "estimation/batch/quietest_rates.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "estimation/batch/grid.h"
#include "estimation/batch/noise_bands.h"
#include "estimation/batch/spectra.h"

namespace imuscope::batch {
namespace {

constexpr Eigen::Index kWindow = 256;
constexpr double kFrom_hz = 1.0;
constexpr double kTo_hz = 7.0;
/// Frequencies of either half of a band. One between the halves is left out: neighbours share what the window's ends
/// spread.
constexpr Eigen::Index kHalf = 4;

/// Power of the rates in each window (row) and band (column), mean over axes, by the lower and the upper half of the
/// band's frequencies.
struct HalvesOfRates {
  Eigen::ArrayXXd chooses;
  Eigen::ArrayXXd reads;
};
HalvesOfRates halves_of_rates(const Spectra& rates, const WindowPlan& plan) {
  constexpr Eigen::Index kBand = 2 * kHalf + 1;
  const auto first = static_cast<Eigen::Index>(std::ceil(kFrom_hz / plan.frequency_step_hz));
  const Eigen::Index n_bands = (plan.n_frequencies - first) / kBand;
  const auto n_windows = static_cast<Eigen::Index>(plan.starts.size());
  HalvesOfRates halves{Eigen::ArrayXXd::Zero(n_windows, n_bands), Eigen::ArrayXXd::Zero(n_windows, n_bands)};
  for (Eigen::Index band = 0; band < n_bands; ++band) {
    for (Eigen::Index w = 0; w < n_windows; ++w) {
      const auto mean_power = [&](Eigen::Index from) {
        double sum = 0.0;
        for (Eigen::Index k = from; k < from + kHalf; ++k) sum += rates.row(w, k).squaredNorm();
        return kWindowsPerInstant * sum / static_cast<double>(3 * kHalf);
      };
      halves.chooses(w, band) = mean_power(first + band * kBand);
      halves.reads(w, band) = mean_power(first + band * kBand + kHalf + 1);
    }
  }
  return halves;
}

}  // namespace

// B-21a: N
double quietest_gyro_white_radps_per_sqrt_hz(
    const Eigen::Ref<const Eigen::Matrix<double, Eigen::Dynamic, 3>, 0, Eigen::OuterStride<>>& omega_radps,
    const std::vector<char>& valid) {
  constexpr std::size_t kQuietest = 50;
  const WindowPlan plan = plan_windows_of(kWindow, valid, kGridRate_hz, kTo_hz);
  if (plan.starts.empty()) return std::numeric_limits<double>::infinity();
  const HalvesOfRates halves = halves_of_rates(Spectra(plan, omega_radps), plan);
  const Eigen::ArrayXd least = halves.chooses.rowwise().minCoeff();
  std::vector<Eigen::Index> windows(static_cast<std::size_t>(least.size()));
  std::iota(windows.begin(), windows.end(), Eigen::Index{0});
  const std::size_t n = std::min(windows.size(), windows.size() / kQuietest + 2);
  std::ranges::nth_element(windows, windows.begin() + static_cast<std::ptrdiff_t>(n - 1), {},
                           [&](Eigen::Index w) { return least[w]; });
  windows.resize(n);
  Eigen::Index band = 0;
  halves.chooses(windows, Eigen::all).colwise().sum().minCoeff(&band);
  return std::sqrt(halves.reads(windows, band).mean() / kGridRate_hz);
}

}  // namespace imuscope::batch
