#include "estimation/regimes/motion_regimes.h"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>

#include "base/contracts.h"

namespace imuscope {

namespace {

constexpr std::size_t kStatic = 0;
constexpr std::size_t kDynamic = 1;

std::size_t cells_in(double s) { return static_cast<std::size_t>(std::lround(s / MotionLevels::kCell_s)); }

/// Cells that the two ends of a stop may lose.
constexpr std::size_t kLostAtEnds = 2;

RegimeTrack track_of(const MotionLevels& levels, std::vector<std::string> names,
                     const std::vector<std::optional<std::size_t>>& regimes) {
  std::vector<RegimeStretch> stretches;
  for (std::size_t i = 0; i < regimes.size(); ++i) {
    if (regimes[i]) stretches.push_back({levels.begin_of(i), levels.begin_of(i + 1), *regimes[i]});
  }
  return {std::move(names), stretches};
}

/// Cells [first, last) and their measure of intensity.
struct Block {
  std::size_t first;
  std::size_t last;
  double measure;
};

std::optional<double> measure_of(const std::vector<MotionCell>& cells, std::size_t first, std::size_t last,
                                 Intensity intensity) {
  double sum = 0.0;
  int n = 0;
  for (std::size_t i = first; i < last; ++i) {
    const MotionCell& cell = cells[i];
    if (cell.n == 0 || (intensity == Intensity::kSpeed && !cell.speed_mps)) continue;
    ++n;
    switch (intensity) {
      case Intensity::kRate:
        sum += cell.rate_rms_radps * cell.rate_rms_radps;
        break;
      case Intensity::kVibration:
        sum += cell.vibration_mps2 * cell.vibration_mps2;
        break;
      case Intensity::kSpeed:
        sum += *cell.speed_mps;
        break;
    }
  }
  if (n == 0) return std::nullopt;
  return intensity == Intensity::kSpeed ? sum / n : std::sqrt(sum / n);
}

/// The dynamic stretches in blocks; what is left at a stretch's end belongs to its last block.
std::vector<Block> blocks_of(const std::vector<MotionCell>& cells, const MotionLevels& levels,
                             const RegimeTrack& motion, Intensity intensity, std::size_t length) {
  std::vector<Block> blocks;
  const auto is_dynamic = [&](std::size_t i) { return motion.at(levels.begin_of(i)) == kDynamic; };
  for (std::size_t i = 0; i < cells.size();) {
    std::size_t end = i;
    while (end < cells.size() && is_dynamic(end)) ++end;
    while (i < end) {
      const std::size_t last = end - i < 2 * length ? end : i + length;
      if (const auto measure = measure_of(cells, i, last, intensity)) blocks.push_back({i, last, *measure});
      i = last;
    }
    while (i < cells.size() && !is_dynamic(i)) ++i;
  }
  return blocks;
}

}  // namespace

RegimeTrack static_and_dynamic(const MotionLevels& levels, const MotionLimits& limits) {
  const auto cells = levels.cells();
  return static_and_dynamic(levels, cells, limits, cell_noise(cells));
}

RegimeTrack static_and_dynamic(const MotionLevels& levels, const std::vector<MotionCell>& cells,
                               const MotionLimits& limits, const CellNoise& noise) {
  std::vector<std::optional<std::size_t>> regimes(cells.size(), kDynamic);
  const std::size_t guard = cells_in(limits.guard_s);
  const std::size_t shortest = cells_in(limits.shortest_static_s);
  const auto fill = [&](std::size_t first, std::size_t last, std::optional<std::size_t> regime) {
    std::fill(regimes.begin() + static_cast<std::ptrdiff_t>(first),
              regimes.begin() + static_cast<std::ptrdiff_t>(std::max(first, last)), regime);
  };
  for (const auto& stop : find_standstills(cells, limits, noise)) {
    const bool begins = stop.first > 0;
    const bool ends = stop.last < cells.size();
    fill(begins ? stop.first - std::min(guard, stop.first) : 0, std::min(cells.size(), stop.last + guard),
         std::nullopt);
    if (begins && ends && stop.last - stop.first + kLostAtEnds < shortest) continue;
    fill(stop.first + (begins ? guard : 0), stop.last - (ends ? std::min(guard, stop.last) : 0), kStatic);
  }
  return track_of(levels, {kStaticName, kDynamicName}, regimes);
}

RegimeTrack intensity_bins(const MotionLevels& levels, const RegimeTrack& motion, Intensity intensity,
                           int bins, double block_s) {
  IMUSCOPE_EXPECTS(bins >= 2 && block_s > 0.0);
  const auto cells = levels.cells();
  const auto length = std::max<std::size_t>(1, cells_in(block_s));
  const auto blocks = blocks_of(cells, levels, motion, intensity, length);
  std::vector<double> sorted;
  for (const auto& block : blocks) sorted.push_back(block.measure);
  std::sort(sorted.begin(), sorted.end());
  std::vector<double> edges;
  for (int k = 1; k < bins && !sorted.empty(); ++k) {
    const std::size_t above = sorted.size() * static_cast<std::size_t>(k) / static_cast<std::size_t>(bins);
    edges.push_back(above > 0 ? 0.5 * (sorted[above - 1] + sorted[above]) : sorted.front());
  }

  std::vector<std::string> names{kStaticName};
  for (int k = 1; k <= bins; ++k) names.push_back(fmt::format("intensity {} of {}", k, bins));
  std::vector<std::optional<std::size_t>> regimes(cells.size());
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (motion.at(levels.begin_of(i)) == kStatic) regimes[i] = kStatic;
  }
  const auto bin_of = [&](double measure) {
    return static_cast<std::size_t>(std::upper_bound(edges.begin(), edges.end(), measure) - edges.begin()) +
           1;
  };
  std::size_t now = 0;
  std::size_t end_of_last = 0;
  for (const auto& block : blocks) {
    const std::size_t alone = bin_of(block.measure);
    const auto is_clear_of = [&](double edge) {
      return std::abs(block.measure - edge) >= kIntensityEdge * edge;
    };
    const bool follows = now != 0 && block.first == end_of_last;
    std::size_t bin = follows ? now : alone;
    // Edge by edge, from the bin that holds.
    while (bin < alone && is_clear_of(edges[bin - 1])) ++bin;
    while (bin > alone && is_clear_of(edges[bin - 2])) --bin;
    std::fill(regimes.begin() + static_cast<std::ptrdiff_t>(block.first),
              regimes.begin() + static_cast<std::ptrdiff_t>(block.last), std::optional(bin));
    now = bin;
    end_of_last = block.last;
  }
  return track_of(levels, std::move(names), regimes);
}

}  // namespace imuscope
