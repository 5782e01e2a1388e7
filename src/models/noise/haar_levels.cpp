#include "models/noise/haar_levels.h"

#include <Eigen/Core>
#include <bit>
#include <cmath>
#include <cstring>
#include <numeric>

#include "models/noise/work_memory.h"

// Other processors than x86 have their widest registers anyhow. What chooses between clones runs before
// ThreadSanitizer has set itself up, and would end the program.
#if defined(__SANITIZE_THREAD__) || !defined(__x86_64__)
#define IMUSCOPE_CLONES
#else
#define IMUSCOPE_CLONES __attribute__((target_clones("avx2", "default")))
#endif

namespace imuscope::noise {
namespace {

using Array = Eigen::Map<Eigen::ArrayXd>;
/// Samples handled at once: four such stretches of doubles stay in the first-level cache.
constexpr std::size_t kStretch = 512;

Array stretch(std::vector<double>& blocks, std::size_t at, std::size_t length) {
  return {blocks.data() + at, static_cast<Eigen::Index>(length)};
}

void subtract_first(std::span<const double> run, std::vector<double>& out) {
  out.resize(run.size());
  const Eigen::Map<const Eigen::ArrayXd> in(run.data(), static_cast<Eigen::Index>(run.size()));
  stretch(out, 0, out.size()) = in - run.front();
}

double scale_of(int level) { return std::ldexp(1.0, -2 * level); }  // 1 / (2n)^2

/// Four neighbouring samples at once; the same arithmetic in two halves where the processor has no wider
/// registers, so that the result does not depend on it.
using Lanes = double __attribute__((vector_size(32)));
constexpr std::size_t kLanes = 4;

/// G-1. Squares of one level over [from, to), without moving on to the next.
double squares(const double* f, std::size_t n, std::size_t from, std::size_t to) {
  double sum = 0.0;
  for (std::size_t s = from; s < to; s += kStretch) {
    const auto length = static_cast<Eigen::Index>(std::min(kStretch, to - s));
    const Eigen::Map<const Eigen::ArrayXd> older(f + s, length);
    const Eigen::Map<const Eigen::ArrayXd> newer(f + s + n, length);
    sum += (older - newer).square().sum();
  }
  return sum;
}

struct PairOfSums {
  double lower = 0.0;
  double upper = 0.0;
};

/// Squares of two levels over a stretch of at most kStretch; leaves at f the block sums of 4n samples. Reads
/// run ahead of writes, so that the next stretch finds what it needs.
IMUSCOPE_CLONES PairOfSums two_levels_of_stretch(double* f, std::size_t n, std::size_t length) {
  Lanes lower{};
  Lanes upper{};
  std::size_t s = 0;
  for (; s + kLanes <= length; s += kLanes) {
    Lanes b0;
    Lanes b1;
    Lanes b2;
    Lanes b3;
    std::memcpy(&b0, f + s, sizeof(Lanes));
    std::memcpy(&b1, f + s + n, sizeof(Lanes));
    std::memcpy(&b2, f + s + 2 * n, sizeof(Lanes));
    std::memcpy(&b3, f + s + 3 * n, sizeof(Lanes));
    const Lanes low = b1 - b0;
    lower += low * low;
    const Lanes older = b0 + b1;
    const Lanes newer = b2 + b3;
    const Lanes up = newer - older;
    upper += up * up;
    const Lanes sum = older + newer;
    std::memcpy(f + s, &sum, sizeof(Lanes));
  }
  PairOfSums sums{(lower[0] + lower[1]) + (lower[2] + lower[3]),
                  (upper[0] + upper[1]) + (upper[2] + upper[3])};
  for (; s < length; ++s) {
    const double low = f[s + n] - f[s];
    sums.lower += low * low;
    const double older = f[s] + f[s + n];
    const double newer = f[s + 2 * n] + f[s + 3 * n];
    sums.upper += (newer - older) * (newer - older);
    f[s] = older + newer;
  }
  return sums;
}

/// Takes `level` and the next one from `length` block sums at `f`, n places from a sum to the one after it,
/// and leaves the length - 3n sums of the level after them there. Squares count for the first `own` positions
/// only, sums go on beyond them. Precondition: length > 3n.
template <typename Add>
void take_two_levels(double* f, int level, std::size_t n, std::size_t length, std::size_t own,
                     const Add& add) {
  const std::size_t lower_count = std::min(own, length - n);
  const std::size_t upper_count = std::min(own, length - 3 * n);
  // The lower level reaches further than the upper one; its last part comes first, before the sums move on.
  PairOfSums total{squares(f, n, upper_count, lower_count), 0.0};
  for (std::size_t s = 0; s < upper_count; s += kStretch) {
    const PairOfSums sums = two_levels_of_stretch(f + s, n, std::min(kStretch, upper_count - s));
    total.lower += sums.lower;
    total.upper += sums.upper;
  }
  for (std::size_t s = upper_count; s < length - 3 * n; s += kStretch) {
    (void)two_levels_of_stretch(f + s, n, std::min(kStretch, length - 3 * n - s));
  }
  add(level, total.lower, lower_count);
  add(level + 1, total.upper, upper_count);
}

/// Levels first..last, as far as `length` sums of 2^(first-1) samples reach, n places from a sum to the one
/// after it.
template <typename Add>
void take_levels(double* f, int first, int last, std::size_t n, std::size_t length, std::size_t own,
                 const Add& add) {
  for (int level = first; level <= last; level += 2) {
    if (level == last || length <= 3 * n) {
      if (length > n) add(level, squares(f, n, 0, std::min(own, length - n)), std::min(own, length - n));
      return;
    }
    take_two_levels(f, level, n, length, own, add);
    length -= 3 * n;
    n *= 4;
  }
}

/// Levels whose supports are short beside a block that fits the second-level cache. Even.
constexpr int kLowLevels = 12;
constexpr std::size_t kBlock = 32768;

/// Levels 1..kLowLevels, block by block in cache (neighbouring blocks share one support). Leaves in `work`
/// the sums of 2^kLowLevels samples. `add` takes level, sum and count. Precondition: the run has levels
/// beyond these.
/// @param work  as long as the run, or the run itself: a block is read before it is written
template <typename Add>
void low_level_squares(std::span<const double> run, double* work, const Add& add) {
  constexpr std::size_t kSupport = std::size_t{1} << static_cast<unsigned>(kLowLevels);
  std::vector<double> local;
  const double first = run.front();
  for (std::size_t start = 0; start < run.size(); start += kBlock) {
    const std::size_t own = std::min(kBlock, run.size() - start);
    std::size_t length = std::min(own + kSupport - 1, run.size() - start);
    local.resize(length);
    const Eigen::Map<const Eigen::ArrayXd> in(run.data() + start, static_cast<Eigen::Index>(length));
    stretch(local, 0, length) = in - first;
    const std::size_t kept = length >= kSupport ? std::min(own, length - kSupport + 1) : 0;
    take_levels(local.data(), 1, kLowLevels, 1, length, own, add);
    std::copy_n(local.begin(), kept, work + start);
  }
}

/// Doubles of a strip, which stays in the second-level cache; no narrower than a line of it.
constexpr std::size_t kStripDoubles = 65536;
constexpr std::size_t kLeastWidth = 8;

/// What the longest strip of a run takes.
std::size_t strip_doubles(std::size_t length) {
  const std::size_t rows = (length >> static_cast<unsigned>(kLowLevels)) + 1;
  return std::max(kStripDoubles, rows * kLeastWidth);
}

/// Levels kLowLevels + 1..last from the sums of 2^kLowLevels samples. Positions a whole number of such sums
/// apart meet on all these levels and meet no others: strip by strip of them, every level in cache, with the
/// strip's width for the distance of two sums.
/// @param strip  strip_doubles(run.size()) of them
template <typename Add>
void high_level_squares(std::span<const double> sums, int last, double* strip, const Add& add) {
  constexpr std::size_t kSupport = std::size_t{1} << static_cast<unsigned>(kLowLevels);
  const std::size_t longer = sums.size() % kSupport;  // strips before it have a row more
  for (std::size_t begin = 0; begin < std::min(kSupport, sums.size());) {
    const std::size_t rows = sums.size() / kSupport + (begin < longer ? 1 : 0);
    const std::size_t width =
        std::min((begin < longer ? longer : kSupport) - begin, std::max(kLeastWidth, kStripDoubles / rows));
    for (std::size_t row = 0; row < rows; ++row) {
      std::copy_n(sums.begin() + static_cast<std::ptrdiff_t>(begin + row * kSupport), width,
                  strip + row * width);
    }
    take_levels(strip, kLowLevels + 1, last, width, rows * width, rows * width, add);
    begin += width;
  }
}

}  // namespace

int highest_level(std::size_t length) noexcept {
  return length < 2 ? 0 : static_cast<int>(std::bit_width(length)) - 1;
}

// G-33: of one coefficient, in units of m B_m and of w
MissingExcess missing_excess(std::size_t n, std::size_t older, std::size_t newer) noexcept {
  MissingExcess out;
  for (const std::size_t there : {older, newer}) {
    if (there == n) continue;
    const auto missing = static_cast<double>(n - there);
    const double own = 0.25 * missing / (static_cast<double>(there) * static_cast<double>(there));
    out += {own, own * missing / static_cast<double>(n)};
  }
  return out;
}

void HoleLengths::add(std::uint64_t missing) noexcept {
  if (missing == 0) return;
  const std::size_t scale = std::min(kScales - 1, static_cast<std::size_t>(std::bit_width(missing)) - 1);
  samples_[scale] += static_cast<double>(missing);
  holes_[scale] += 1.0;
}

void HoleLengths::merge(const HoleLengths& other) noexcept {
  for (std::size_t i = 0; i < kScales; ++i) {
    samples_[i] += other.samples_[i];
    holes_[i] += other.holes_[i];
  }
}

// G-33: m B_m of the holes, less w
double HoleLengths::variance_of(const MissingExcess& excess, std::span<const double> below) const noexcept {
  const double n = std::ldexp(1.0, static_cast<int>(below.size()));
  // m times the sum of the levels above scale log2(m), straight in log2(m) between two of them; the last
  // factor is that of drawing without putting back.
  const auto of_length = [&](double m) {
    const double at = std::log2(m);
    const auto whole = static_cast<std::size_t>(at);
    double beyond = 0.0;
    for (std::size_t k = below.size(); k-- > whole + 1;) beyond += below[k];
    const double here = whole < below.size() ? below[whole] : 0.0;
    return m * (beyond + (1.0 - (at - static_cast<double>(whole))) * here) / (1.0 - m / n);
  };
  double sum = 0.0;
  double weight = 0.0;
  for (std::size_t i = 0; i < kScales; ++i) {
    if (holes_[i] == 0.0) continue;
    const double m = samples_[i] / holes_[i];
    if (m > n / 8.0) break;
    sum += samples_[i] * of_length(m);
    weight += samples_[i];
  }
  // Where only longer holes are, a half reaches into one of them by up to an eighth.
  const double within = weight > 0.0 ? sum / weight : of_length(std::max(1.0, n / 16.0));
  return excess.own * within - excess.common * of_length(std::max(1.0, n / 8.0));
}

namespace {

int levels_of(std::span<const double> run, std::span<const LevelSum> sums) {
  return std::min(static_cast<int>(sums.size()), highest_level(run.size()));
}

/// Doubles that add_squares_by() needs for its strip.
std::size_t strip_of(std::span<const double> run, std::span<const LevelSum> sums) {
  return levels_of(run, sums) > kLowLevels ? strip_doubles(run.size()) : 0;
}

/// @param work   as that of low_level_squares()
/// @param strip  strip_of() doubles
void add_squares_by(std::span<const double> run, double* work, double* strip, std::span<LevelSum> sums) {
  const int levels = levels_of(run, sums);
  if (levels < 1) return;
  const auto add = [&](int level, double sum, std::size_t count) {
    auto& total = sums[static_cast<std::size_t>(level - 1)];
    total.sum_of_squares += sum * scale_of(level);
    total.count += count;
  };
  if (levels <= kLowLevels) {
    std::vector<double> short_run;
    subtract_first(run, short_run);
    take_levels(short_run.data(), 1, levels, 1, run.size(), run.size(), add);
    return;
  }
  low_level_squares(run, work, add);
  constexpr std::size_t kSupport = std::size_t{1} << static_cast<unsigned>(kLowLevels);
  const std::size_t sums_left = run.size() - kSupport + 1;
  high_level_squares({work, sums_left}, levels, strip, add);
}

}  // namespace

void add_squares(std::span<const double> run, std::span<LevelSum> sums) {
  // In one piece: the library gives memory back to the system where more than twice the largest piece is free,
  // and takes it anew, page by page, at the next call.
  const WorkMemory memory(run.size() + strip_of(run, sums));
  add_squares_by(run, memory.data(), memory.data() + run.size(), sums);
}

void add_squares_in_place(std::span<double> run, std::span<LevelSum> sums) {
  const WorkMemory strip(strip_of(run, sums));
  add_squares_by(run, run.data(), strip.data(), sums);
}

HaarLevels::HaarLevels(std::span<const double> x, std::span<const Segment> runs)
    : begin_(runs.front().begin) {
  const std::size_t begin = begin_;
  const std::size_t length = runs.back().end - begin;
  if (runs.size() == 1) {
    subtract_first(x.subspan(begin, length), blocks_);
    return;
  }
  blocks_.resize(length, 0.0);
  before_.resize(length + 1, 0);
  for (const Segment& run : runs) {
    for (std::size_t i = run.begin; i < run.end; ++i) {
      blocks_[i - begin] = x[i] - x[begin];
      before_[i - begin + 1] = 1;
    }
  }
  std::partial_sum(before_.begin(), before_.end(), before_.begin());
}

void HaarLevels::append_whole(std::size_t n, std::vector<double>& coefficients) {
  const std::size_t count = blocks_.size() - n;
  const double scale = 0.5 / static_cast<double>(n);
  const std::size_t had = coefficients.size();
  coefficients.resize(had + count);
  stretch(coefficients, had, count) = (stretch(blocks_, n, count) - stretch(blocks_, 0, count)) * scale;
  stretch(blocks_, 0, count) += stretch(blocks_, n, count);
}

void HaarLevels::append_of_valid(std::size_t n, std::vector<double>& coefficients, MissingExcess& excess,
                                 std::vector<Segment>& places) {
  const std::size_t count = blocks_.size() - n;
  const std::size_t least = least_valid(n);
  for (std::size_t s = 0; s < count; ++s) {
    const std::size_t older = before_[s + n] - before_[s];
    const std::size_t newer = before_[s + 2 * n] - before_[s + n];
    if (older >= least && newer >= least) {
      coefficients.push_back(
          0.5 * (blocks_[s + n] / static_cast<double>(newer) - blocks_[s] / static_cast<double>(older)));
      excess += missing_excess(n, older, newer);
      const std::size_t newest = begin_ + s + 2 * n - 1;
      if (places.empty() || places.back().end != newest) places.push_back({newest, newest});
      ++places.back().end;
    }
    blocks_[s] += blocks_[s + n];
  }
}

bool HaarLevels::append_next(std::vector<double>& coefficients, MissingExcess& excess,
                             std::vector<Segment>& places) {
  const std::size_t n = std::size_t{1} << static_cast<unsigned>(level_);
  if (blocks_.size() < n + 1) return false;
  const std::size_t had = coefficients.size();
  if (before_.empty())
    append_whole(n, coefficients);
  else
    append_of_valid(n, coefficients, excess, places);
  blocks_.resize(blocks_.size() - n);
  ++level_;
  return coefficients.size() > had;
}

}  // namespace imuscope::noise
