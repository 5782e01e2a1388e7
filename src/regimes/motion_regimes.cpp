#include "regimes/motion_regimes.h"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>

#include "base/contracts.h"

namespace imuscope {

namespace {

constexpr std::size_t kStatic = 0;
constexpr std::size_t kDynamic = 1;

/// Half a window in cells: levels are looked at over 1 s, their spread about a mean over 6 s.
constexpr std::ptrdiff_t kLevelHalf = 2;
constexpr std::ptrdiff_t kMeanHalf = 15;
/// Factor on the limits of rate, force and vibration where a speed says that the vehicle stands.
constexpr double kShaking = 3.0;
/// A speed counts as motion only where it exceeds so many of its own standard deviations.
constexpr double kSpeedSds = 4.0;

/// Sums over cells before index i, so that a window costs two differences.
class RunningSums {
 public:
  RunningSums(const std::vector<MotionCell>& cells, Vector3 MotionCell::*what) {
    sums_.push_back({});
    counts_.push_back(0);
    for (const auto& cell : cells) {
      Vector3 sum = sums_.back();
      for (std::size_t i = 0; i < 3 && cell.n > 0; ++i) sum[i] += (cell.*what)[i];
      sums_.push_back(sum);
      counts_.push_back(counts_.back() + (cell.n > 0 ? 1 : 0));
    }
  }
  /// Mean over the known cells of [first, last); zero without any.
  [[nodiscard]] Vector3 mean(std::ptrdiff_t first, std::ptrdiff_t last) const {
    const auto end = static_cast<std::ptrdiff_t>(counts_.size()) - 1;
    const auto a = static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(first, 0, end));
    const auto b = static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(last, 0, end));
    Vector3 mean{};
    if (counts_[b] == counts_[a]) return mean;
    for (std::size_t i = 0; i < 3; ++i)
      mean[i] = (sums_[b][i] - sums_[a][i]) / static_cast<double>(counts_[b] - counts_[a]);
    return mean;
  }

 private:
  std::vector<Vector3> sums_;
  std::vector<std::size_t> counts_;
};

/// Rms distance of the cell means within 1 s from the mean of 6 s.
std::vector<double> spreads(const std::vector<MotionCell>& cells, Vector3 MotionCell::*what) {
  const RunningSums sums(cells, what);
  std::vector<double> out(cells.size());
  const auto n = static_cast<std::ptrdiff_t>(cells.size());
  for (std::ptrdiff_t i = 0; i < n; ++i) {
    const Vector3 mean = sums.mean(i - kMeanHalf, i + kMeanHalf + 1);
    double squares = 0.0;
    int known = 0;
    for (std::ptrdiff_t j = std::max<std::ptrdiff_t>(0, i - kLevelHalf); j <= std::min(n - 1, i + kLevelHalf);
         ++j) {
      const MotionCell& cell = cells[static_cast<std::size_t>(j)];
      if (cell.n == 0) continue;
      ++known;
      for (std::size_t k = 0; k < 3; ++k)
        squares += ((cell.*what)[k] - mean[k]) * ((cell.*what)[k] - mean[k]);
    }
    out[static_cast<std::size_t>(i)] = known > 0 ? std::sqrt(squares / known) : 0.0;
  }
  return out;
}

struct Judgement {
  bool rest = false;    ///< below every limit for rest
  bool motion = false;  ///< above a limit for motion
};

Judgement judge(const MotionCell& cell, double rate_spread, double force_spread, const MotionLimits& limits) {
  const bool stands = cell.speed_mps && *cell.speed_mps < limits.rest_speed_mps;
  const double room = stands ? kShaking : 1.0;
  const double speed = cell.speed_mps.value_or(0.0);
  const bool fast = speed > std::max(limits.motion_speed_mps, kSpeedSds * cell.speed_sd_mps);
  const bool slow = speed < std::max(limits.rest_speed_mps, kSpeedSds * cell.speed_sd_mps);
  return {slow && rate_spread < room * limits.rest_rate_spread_radps &&
              force_spread < room * limits.rest_force_spread_mps2 &&
              cell.vibration_mps2 < room * limits.rest_vibration_mps2,
          fast || rate_spread > room * limits.motion_rate_spread_radps ||
              force_spread > room * limits.motion_force_spread_mps2 ||
              cell.vibration_mps2 > room * limits.motion_vibration_mps2};
}

/// Regime of every cell: static from the first cell at rest on, until the last cell at rest before motion.
std::vector<std::size_t> with_hysteresis(const std::vector<MotionCell>& cells, const MotionLimits& limits) {
  const auto rate = spreads(cells, &MotionCell::omega_radps);
  const auto force = spreads(cells, &MotionCell::f_mps2);
  std::vector<std::size_t> regimes(cells.size(), kDynamic);
  std::size_t now = kDynamic;
  std::size_t behind_rest = 0;  // the cell behind the last one at rest; holes count like what surrounds them
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (cells[i].n == 0) {
      regimes[i] = now;
      continue;
    }
    const Judgement j = judge(cells[i], rate[i], force[i], limits);
    if (j.rest) {
      now = kStatic;
      behind_rest = i + 1;
    } else if (j.motion && now == kStatic) {
      now = kDynamic;
      std::fill(regimes.begin() + static_cast<std::ptrdiff_t>(behind_rest),
                regimes.begin() + static_cast<std::ptrdiff_t>(i), kDynamic);
    }
    regimes[i] = now;
  }
  return regimes;
}

/// Gives runs of `regime` shorter than `shortest` cells to what surrounds them.
void drop_short(std::vector<std::size_t>& regimes, std::size_t regime, std::size_t other,
                std::size_t shortest) {
  for (std::size_t i = 0; i < regimes.size();) {
    std::size_t end = i;
    while (end < regimes.size() && regimes[end] == regimes[i]) ++end;
    // The beginning and the end of the recording cut a standstill short.
    const bool inside = i > 0 && end < regimes.size();
    if (regimes[i] == regime && inside && end - i < shortest) {
      std::fill(regimes.begin() + static_cast<std::ptrdiff_t>(i),
                regimes.begin() + static_cast<std::ptrdiff_t>(end), other);
    }
    i = end;
  }
}

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
  auto regimes = with_hysteresis(cells, limits);
  drop_short(regimes, kStatic, kDynamic,
             static_cast<std::size_t>(std::lround(limits.shortest_static_s / MotionLevels::kCell_s)));
  return track_of(levels, {kStaticName, kDynamicName}, {regimes.begin(), regimes.end()});
}

RegimeTrack intensity_bins(const MotionLevels& levels, const RegimeTrack& motion, Intensity intensity,
                           int bins, double block_s) {
  IMUSCOPE_EXPECTS(bins >= 2 && block_s > 0.0);
  const auto cells = levels.cells();
  const auto length =
      std::max<std::size_t>(1, static_cast<std::size_t>(std::lround(block_s / MotionLevels::kCell_s)));
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
