#include "noise/haar_levels.h"

#include <Eigen/Core>
#include <bit>
#include <cmath>

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

/// Squares of one level over [from, to), without moving on to the next.
double squares(std::vector<double>& f, std::size_t n, std::size_t from, std::size_t to) {
  double sum = 0.0;
  for (std::size_t s = from; s < to; s += kStretch) {
    const std::size_t length = std::min(kStretch, to - s);
    sum += (stretch(f, s, length) - stretch(f, s + n, length)).square().sum();
  }
  return sum;
}

/// Squares of two levels in one pass over memory; leaves in f the block sums of 4n samples.
struct PairOfSums {
  double lower = 0.0;
  double upper = 0.0;
};
PairOfSums squares_of_two_levels(std::vector<double>& f, std::size_t n, std::size_t count) {
  PairOfSums sums;
  Eigen::Array<double, Eigen::Dynamic, 1, 0, kStretch, 1> older;
  Eigen::Array<double, Eigen::Dynamic, 1, 0, kStretch, 1> newer;
  for (std::size_t s = 0; s < count; s += kStretch) {
    const std::size_t length = std::min(kStretch, count - s);
    Array b0 = stretch(f, s, length);
    const Array b1 = stretch(f, s + n, length);
    sums.lower += (b0 - b1).square().sum();
    older = b0 + b1;
    newer = stretch(f, s + 2 * n, length) + stretch(f, s + 3 * n, length);
    sums.upper += (older - newer).square().sum();
    // Later stretches read only indices that are not yet overwritten here.
    b0 = older + newer;
  }
  return sums;
}

/// Levels whose supports are short beside a block that fits the second-level cache.
constexpr int kLowLevels = 10;
constexpr std::size_t kBlock = 16384;

/// Levels 1..low_levels, block by block in cache (neighbouring blocks share one support). Leaves in `work`
/// the sums of 2^low_levels samples. `add` takes level, sum and count.
template <typename Add>
void low_level_squares(std::span<const double> run, int low_levels, std::vector<double>& work,
                       const Add& add) {
  const std::size_t support = std::size_t{1} << static_cast<unsigned>(low_levels);
  work.resize(run.size());
  std::vector<double> local;
  for (std::size_t start = 0; start < run.size(); start += kBlock) {
    const std::size_t own = std::min(kBlock, run.size() - start);
    std::size_t length = std::min(own + support - 1, run.size() - start);
    local.resize(length);
    const Eigen::Map<const Eigen::ArrayXd> in(run.data() + start, static_cast<Eigen::Index>(length));
    stretch(local, 0, length) = in - run.front();
    for (int level = 1; level <= low_levels; ++level) {
      const std::size_t n = std::size_t{1} << static_cast<unsigned>(level - 1);
      if (length <= n) break;
      length -= n;  // sums of 2n samples that lie inside
      const std::size_t count = std::min(own, length);
      add(level, squares(local, n, 0, count), count);
      stretch(local, 0, length) += stretch(local, n, length);
    }
    const std::size_t kept = std::min(own, length);
    stretch(work, start, kept) = stretch(local, 0, kept);
  }
}

}  // namespace

int highest_level(std::size_t length) noexcept {
  return length < 2 ? 0 : static_cast<int>(std::bit_width(length)) - 1;
}

void add_squares(std::span<const double> run, std::span<LevelSum> sums, std::vector<double>& work) {
  const int levels = std::min(static_cast<int>(sums.size()), highest_level(run.size()));
  if (levels < 1) return;
  const auto add = [&](int level, double sum, std::size_t count) {
    auto& total = sums[static_cast<std::size_t>(level - 1)];
    total.sum_of_squares += sum * scale_of(level);
    total.count += count;
  };
  const int low_levels = std::min(levels, kLowLevels);
  low_level_squares(run, low_levels, work, add);
  for (int level = low_levels + 1; level <= levels; level += 2) {
    const std::size_t n = std::size_t{1} << static_cast<unsigned>(level - 1);
    const std::size_t count = run.size() - 2 * n + 1;
    if (level == levels) {
      add(level, squares(work, n, 0, count), count);
      break;
    }
    const std::size_t upper_count = count - 2 * n;
    // The lower level reaches further than the upper one; its last part comes first, before the sums move on.
    const double rest = squares(work, n, upper_count, count);
    const PairOfSums pair = squares_of_two_levels(work, n, upper_count);
    add(level, pair.lower + rest, count);
    add(level + 1, pair.upper, upper_count);
  }
}

HaarLevels::HaarLevels(std::span<const double> run) {
  if (!run.empty()) subtract_first(run, blocks_);
}

bool HaarLevels::append_next(std::vector<double>& coefficients) {
  const std::size_t n = std::size_t{1} << static_cast<unsigned>(level_);
  if (blocks_.size() < n + 1) return false;
  const std::size_t count = blocks_.size() - n;
  const double scale = std::ldexp(1.0, -(level_ + 1));
  const std::size_t before = coefficients.size();
  coefficients.resize(before + count);
  stretch(coefficients, before, count) = (stretch(blocks_, n, count) - stretch(blocks_, 0, count)) * scale;
  stretch(blocks_, 0, count) += stretch(blocks_, n, count);
  blocks_.resize(count);
  ++level_;
  return true;
}

}  // namespace imuscope::noise
