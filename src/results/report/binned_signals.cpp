#include "results/report/binned_signals.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/contracts.h"

namespace imuscope::report {
namespace {

void merge(BinnedSignals::Bin& first, const BinnedSignals::Bin& second) {
  first.smallest = std::min(first.smallest, second.smallest);
  first.largest = std::max(first.largest, second.largest);
  first.sum += second.sum;
  if (second.n > 0) first.last = second.last;
  first.n += second.n;
}

}  // namespace

BinnedSignals::BinnedSignals(std::size_t n_signals, std::size_t n_bins_max, double width_s)
    : bins_(n_signals), n_added_(n_bins_max), n_bins_max_(n_bins_max), width_s_(width_s) {
  IMUSCOPE_EXPECTS(n_bins_max >= 2 && n_bins_max % 2 == 0);
  IMUSCOPE_EXPECTS(width_s > 0.0);
  for (auto& bins : bins_) bins.resize(n_bins_max);
}

void BinnedSignals::add(double time_s, std::span<const double> values) {
  IMUSCOPE_EXPECTS(values.size() == bins_.size());
  if (!std::isfinite(time_s)) return;
  if (n_used_ == 0) begin_s_ = time_s;
  while (time_s - begin_s_ >= width_s_ * static_cast<double>(n_bins_max_)) double_width();
  const double place = std::floor(std::max(0.0, (time_s - begin_s_) / width_s_));
  const std::size_t i = std::min(static_cast<std::size_t>(place), n_bins_max_ - 1);
  n_used_ = std::max(n_used_, i + 1);
  ++n_added_[i];
  for (std::size_t signal = 0; signal < values.size(); ++signal) {
    const double value = values[signal];
    if (!std::isfinite(value)) continue;
    merge(bins_[signal][i], Bin{value, value, value, value, 1});
  }
}

void BinnedSignals::coarsen() {
  // Two on average, with allowance for the first and last stretch, which may be cut.
  constexpr double kEnough = 1.9;
  while (n_used_ > 2) {
    const auto in_use = static_cast<double>(
        std::count_if(n_added_.begin(), n_added_.end(), [](std::uint64_t n) { return n > 0; }));
    const auto n = static_cast<double>(std::accumulate(n_added_.begin(), n_added_.end(), std::uint64_t{0}));
    if (n >= kEnough * in_use) return;
    double_width();
  }
}

void BinnedSignals::double_width() {
  for (auto& bins : bins_) {
    for (std::size_t i = 0; i < n_bins_max_ / 2; ++i) {
      Bin both = bins[2 * i];
      merge(both, bins[2 * i + 1]);
      bins[i] = both;
    }
    std::fill(bins.begin() + static_cast<std::ptrdiff_t>(n_bins_max_ / 2), bins.end(), Bin{});
  }
  for (std::size_t i = 0; i < n_bins_max_ / 2; ++i) n_added_[i] = n_added_[2 * i] + n_added_[2 * i + 1];
  std::fill(n_added_.begin() + static_cast<std::ptrdiff_t>(n_bins_max_ / 2), n_added_.end(), 0);
  n_used_ = (n_used_ + 1) / 2;
  width_s_ *= 2.0;
}

}  // namespace imuscope::report
