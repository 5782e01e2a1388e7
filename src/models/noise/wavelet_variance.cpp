#include "models/noise/wavelet_variance.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "models/noise/chi_squared.h"
#include "models/noise/haar_levels.h"
#include "models/noise/process.h"
#include "models/noise/robust_scale.h"

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

Result<void> check_options(std::span<const double> x, const WvOptions& options) {
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
  return {};
}

Result<void> check_samples(std::span<const double> x, const WvOptions& options) {
  if (options.nan_is_gap || all_finite(x)) return {};
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (!std::isfinite(x[i]) && (options.mask.empty() || options.mask[i] != 0)) {
      return work_error(fmt::format("sample {} (counted from 0) of {} is {}", i, x.size(), x[i]),
                        "remove it or let it count as a gap");
    }
  }
  return {};
}

WvLevel level_of(int j, double value, std::uint64_t count) {
  WvLevel level;
  level.level = j;
  level.tau_samples = std::ldexp(1.0, j);
  level.value = value;
  level.n_coefficients = count;
  return level;
}

/// Of one run, block by block in cache.
/// @param run_is_used_up  its memory, where it may be written to; else empty
std::vector<WvLevel> whole_levels(std::span<const double> run, std::span<double> run_is_used_up, int levels) {
  std::vector<LevelSum> sums(static_cast<std::size_t>(std::min(levels, highest_level(run.size()))));
  if (run_is_used_up.empty())
    add_squares(run, sums);
  else
    add_squares_in_place(run_is_used_up, sums);
  std::vector<WvLevel> result;
  for (const LevelSum& sum : sums) {
    result.push_back(level_of(static_cast<int>(result.size()) + 1,
                              sum.sum_of_squares / static_cast<double>(sum.count), sum.count));
  }
  return result;
}

/// G-34: joins stretches over the shortest holes, until there are kMostPlaces of them.
std::vector<Segment> joined(const std::vector<Segment>& places) {
  if (places.size() <= kMostPlaces) return places;
  std::vector<std::size_t> holes;
  for (std::size_t i = 1; i < places.size(); ++i) holes.push_back(places[i].begin - places[i - 1].end);
  const auto last_kept = holes.begin() + static_cast<std::ptrdiff_t>(kMostPlaces - 1);
  std::nth_element(holes.begin(), last_kept, holes.end(), std::greater<>());
  const std::size_t longest = *last_kept;
  std::vector<Segment> out{places.front()};
  for (std::size_t i = 1; i < places.size(); ++i) {
    if (places[i].begin - out.back().end > longest)
      out.push_back(places[i]);
    else
      out.back().end = places[i].end;
  }
  return out;
}

/// The next level of `haar`; nothing where it has no coefficient.
/// @param c  the biweight's constant; absent: classical
/// @param coefficients  room for them
std::optional<WvLevel> next_level(HaarLevels& haar, int j, const std::optional<double>& c,
                                  std::vector<double>& coefficients, MissingExcess& excess) {
  std::vector<Segment> places;
  MissingExcess sum;
  WvLevel level;
  if (c) {
    coefficients.clear();
    if (!haar.append_next(coefficients, sum, places)) return std::nullopt;
    const RobustScale scale = biweight_scale(coefficients, *c);
    level = level_of(j, scale.s2, coefficients.size());
    level.rejected_share = scale.rejected_share;
  } else {
    SquareSum squares;
    if (!haar.add_next(squares, sum, places)) return std::nullopt;
    level = level_of(j, squares.mean(), squares.count());
  }
  level.places = joined(places);
  excess = sum;
  excess *= 1.0 / static_cast<double>(level.n_coefficients);
  return level;
}

/// Level by level, as far as there are coefficients.
/// @param c  the biweight's constant; absent: classical, of several runs
std::vector<WvLevel> levels_by_coefficients(HaarLevels haar, const std::vector<Segment>& segments, int levels,
                                            const std::optional<double>& c) {
  std::vector<WvLevel> result;
  std::vector<MissingExcess> excess;
  std::vector<double> coefficients;
  for (int j = 1; j <= levels; ++j) {
    auto level = next_level(haar, j, c, coefficients, excess.emplace_back());
    if (!level) break;
    result.push_back(std::move(*level));
  }
  HoleLengths holes;
  for (std::size_t i = 1; i < segments.size(); ++i) holes.add(segments[i].begin - segments[i - 1].end);
  take_out_missing(result, excess, holes);
  return result;
}

}  // namespace

// G-33: from the first level on
void take_out_missing(std::vector<WvLevel>& levels, std::span<const MissingExcess> excess,
                      const HoleLengths& holes) {
  // Where missing samples make nearly all of a level (of quantization alone), its own part is not told better
  // than this.
  constexpr double kLeastShare = 1.0 / 16.0;
  std::vector<double> below;
  for (std::size_t i = 0; i < levels.size(); ++i) {
    const double raw = levels[i].value;
    if (excess[i].own > 0.0)
      levels[i].value = std::max(raw - holes.variance_of(excess[i], below), kLeastShare * raw);
    levels[i].inflation = levels[i].value > 0.0 ? raw / levels[i].value : 1.0;
    below.push_back(levels[i].value);
  }
}

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

// G-2
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

namespace {

/// @param used_up  the memory of x, where it may be written to; else empty
Result<WaveletVariance> wavelet_variance(std::span<const double> x, std::span<double> used_up,
                                         const WvOptions& options) {
  if (auto checked = check_options(x, options); !checked) return tl::unexpected(checked.error());
  const bool is_whole = options.mask.empty() && !options.nan_is_gap && !x.empty();
  // What is not finite makes a first level that is not: where the samples are still there afterwards, a look at
  // each of them before would cost what a level costs.
  const bool first_level_tells = is_whole && !options.robust && used_up.empty() && x.size() > 1;
  if (!first_level_tells) {
    if (auto checked = check_samples(x, options); !checked) return tl::unexpected(checked.error());
  }
  WaveletVariance wv;
  wv.n_samples = x.size();
  // Without a mask what was or will be checked is finite: one look at every sample is enough.
  wv.segments = is_whole ? std::vector<Segment>{{0, x.size()}} : valid_segments(x, options.mask);
  std::size_t longest = 0;
  for (const Segment& s : wv.segments) {
    wv.n_valid += s.end - s.begin;
    longest = std::max(longest, s.end - s.begin);
  }
  if (longest < 2) {
    return work_error(
        fmt::format("the longest run of valid samples has {} of the signal's {}", longest, x.size()),
        "a wavelet variance needs at least 2 in a row");
  }
  const int wanted = options.levels > 0 ? options.levels : kMaxLevel;
  if (options.robust) {
    const double c = options.robust->tuning_constant.value_or(biweight_constant(options.robust->efficiency));
    wv.efficiency = options.robust->efficiency;
    wv.levels = levels_by_coefficients(HaarLevels(x, wv.segments), wv.segments, wanted, c);
  } else if (wv.segments.size() > 1) {
    wv.levels = levels_by_coefficients(
        used_up.empty() ? HaarLevels(x, wv.segments) : HaarLevels::in_place(used_up, wv.segments),
        wv.segments, wanted, std::nullopt);
  } else {
    const std::size_t begin = wv.segments.front().begin;
    wv.levels = whole_levels(x.subspan(begin, longest),
                             used_up.empty() ? used_up : used_up.subspan(begin, longest), wanted);
  }
  if (first_level_tells && !std::isfinite(wv.levels.front().value)) {
    if (auto checked = check_samples(x, options); !checked) return tl::unexpected(checked.error());
  }
  if (const auto possible = static_cast<int>(wv.levels.size()); options.levels > possible) {
    return work_error(
        fmt::format("{} levels need {} samples with few missing, and the longest run of valid samples has {}",
                    options.levels, std::uint64_t{1} << static_cast<unsigned>(options.levels), longest),
        fmt::format("ask for at most {} levels", possible));
  }
  set_intervals(wv.levels, wv.efficiency, options.confidence);
  return wv;
}

}  // namespace

Result<WaveletVariance> haar_wavelet_variance(std::span<const double> x, const WvOptions& options) {
  return wavelet_variance(x, {}, options);
}

Result<WaveletVariance> haar_wavelet_variance_in_place(std::span<double> x, const WvOptions& options) {
  return wavelet_variance(x, x, options);
}

}  // namespace imuscope::noise
