#include "noise/wavelet_variance.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

#include "noise/chi_squared.h"
#include "noise/haar_levels.h"
#include "noise/process.h"
#include "noise/robust_scale.h"

namespace imuscope::noise {
namespace {

bool usable(std::span<const double> x, std::span<const std::uint8_t> mask, std::size_t i) {
  return (mask.empty() || mask[i] != 0) && std::isfinite(x[i]);
}

/// One pass without a branch a sample: what is not finite turns the sum into NaN.
bool all_finite(std::span<const double> x) {
  const Eigen::Map<const Eigen::ArrayXd> values(x.data(), static_cast<Eigen::Index>(x.size()));
  return (values * 0.0).sum() == 0.0;
}

Result<void> check(std::span<const double> x, const WvOptions& options) {
  if (!options.mask.empty() && options.mask.size() != x.size()) {
    return work_error(
        fmt::format("the mask has {} entries and the signal {}", options.mask.size(), x.size()));
  }
  if (options.levels < 0 || options.levels > kMaxLevel) {
    return usage_error(fmt::format("{} levels are asked for", options.levels),
                       fmt::format("give a number from 1 to {}", kMaxLevel));
  }
  if (options.robust && !(options.robust->efficiency >= 0.2 && options.robust->efficiency <= 0.99)) {
    return usage_error(
        fmt::format("a robust efficiency of {} is outside 0.2..0.99", options.robust->efficiency));
  }
  if (options.nan_is_gap || all_finite(x)) return {};
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (!std::isfinite(x[i]) && (options.mask.empty() || options.mask[i] != 0)) {
      return work_error(fmt::format("sample {} (counted from 0) of {} is {}", i, x.size(), x[i]),
                        "remove it or let it count as a gap");
    }
  }
  return {};
}

std::vector<WvLevel> classical_levels(std::span<const double> x, const std::vector<Segment>& segments,
                                      int levels) {
  std::vector<LevelSum> sums(static_cast<std::size_t>(levels));
  std::vector<double> work;
  for (const Segment& s : segments) add_squares(x.subspan(s.begin, s.end - s.begin), sums, work);
  std::vector<WvLevel> result;
  for (int j = 1; j <= levels; ++j) {
    const LevelSum& sum = sums[static_cast<std::size_t>(j - 1)];
    WvLevel level;
    level.level = j;
    level.tau_samples = std::ldexp(1.0, j);
    level.n_coefficients = sum.count;
    level.value = sum.sum_of_squares / static_cast<double>(sum.count);
    result.push_back(level);
  }
  return result;
}

std::vector<WvLevel> robust_levels(std::span<const double> x, const std::vector<Segment>& segments,
                                   int levels, double c) {
  std::vector<HaarLevels> runs;
  for (const Segment& s : segments) runs.emplace_back(x.subspan(s.begin, s.end - s.begin));
  std::vector<WvLevel> result;
  std::vector<double> coefficients;
  for (int j = 1; j <= levels; ++j) {
    coefficients.clear();
    for (HaarLevels& run : runs) run.append_next(coefficients);
    const RobustScale scale = biweight_scale(coefficients, c);
    WvLevel level;
    level.level = j;
    level.tau_samples = std::ldexp(1.0, j);
    level.n_coefficients = coefficients.size();
    level.value = scale.s2;
    level.rejected_share = scale.rejected_share;
    result.push_back(level);
  }
  return result;
}

}  // namespace

bool has_enough_coefficients(const WvLevel& level, double efficiency) noexcept {
  constexpr double kEnough = 3.0;
  return efficiency * static_cast<double>(level.n_coefficients) >= kEnough * level.tau_samples;
}

std::vector<Segment> valid_segments(std::span<const double> x, std::span<const std::uint8_t> mask) {
  if (mask.empty() && !x.empty() && all_finite(x)) return {{0, x.size()}};
  std::vector<Segment> segments;
  std::size_t i = 0;
  while (i < x.size()) {
    while (i < x.size() && !usable(x, mask, i)) ++i;
    const std::size_t begin = i;
    while (i < x.size() && usable(x, mask, i)) ++i;
    if (i > begin) segments.push_back({begin, i});
  }
  return segments;
}

void set_intervals(std::vector<WvLevel>& levels, double efficiency, double confidence) {
  const double tail = 0.5 * (1.0 - confidence);
  const double widening = 1.0 / std::sqrt(efficiency);
  double smallest_low = std::numeric_limits<double>::infinity();
  for (WvLevel& level : levels) {
    const double eta = std::max(static_cast<double>(level.n_coefficients) / level.tau_samples, 1.0);
    const double low = level.value * eta / chi_squared_quantile(eta, 1.0 - tail);
    const double high = level.value * eta / chi_squared_quantile(eta, tail);
    if (efficiency >= 1.0) {
      level.ci_low = low;
      level.ci_high = high;
      continue;
    }
    level.ci_low = level.value - (level.value - low) * widening;
    level.ci_high = level.value + (high - level.value) * widening;
    if (level.ci_low <= 0.0) level.ci_low = std::min(0.5 * level.value, smallest_low);
    smallest_low = std::min(smallest_low, level.ci_low);
  }
}

Result<WaveletVariance> haar_wavelet_variance(std::span<const double> x, const WvOptions& options) {
  if (auto checked = check(x, options); !checked) return tl::unexpected(checked.error());
  WaveletVariance wv;
  wv.n_samples = x.size();
  wv.segments = valid_segments(x, options.mask);
  std::size_t longest = 0;
  for (const Segment& s : wv.segments) {
    wv.n_valid += s.end - s.begin;
    longest = std::max(longest, s.end - s.begin);
  }
  const int possible = highest_level(longest);
  if (possible < 1) {
    return work_error(
        fmt::format("the longest run of valid samples has {} of the signal's {}", longest, x.size()),
        "a wavelet variance needs at least 2 in a row");
  }
  if (options.levels > possible) {
    return work_error(
        fmt::format("{} levels need {} valid samples in a row, and the longest run has {}", options.levels,
                    std::uint64_t{1} << static_cast<unsigned>(options.levels), longest),
        fmt::format("ask for at most {} levels", possible));
  }
  const int levels = options.levels > 0 ? options.levels : std::min(possible, kMaxLevel);
  if (options.robust) {
    const double c = options.robust->tuning_constant.value_or(biweight_constant(options.robust->efficiency));
    wv.efficiency = options.robust->efficiency;
    wv.levels = robust_levels(x, wv.segments, levels, c);
  } else {
    wv.levels = classical_levels(x, wv.segments, levels);
  }
  set_intervals(wv.levels, wv.efficiency, options.confidence);
  return wv;
}

}  // namespace imuscope::noise
