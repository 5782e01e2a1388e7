#include "models/noise/streaming_wv.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>

#include "base/contracts.h"

namespace imuscope::noise {
namespace {

constexpr int kMaxStreamingLevels = 24;
/// Squares are added to a short sum first: its rounding error does not grow with the length of the stream.
constexpr std::uint64_t kSettleEvery = 1024;
constexpr std::uint64_t kWordBits = 64;

/// Bits of a word. Without the processor's own instruction the standard library's is a call.
std::uint32_t valid_in(std::uint64_t bits) noexcept {
  constexpr std::uint64_t kPairs = 0x5555'5555'5555'5555;
  constexpr std::uint64_t kNibbles = 0x3333'3333'3333'3333;
  constexpr std::uint64_t kBytes = 0x0f0f'0f0f'0f0f'0f0f;
  constexpr std::uint64_t kOnes = 0x0101'0101'0101'0101;
  bits -= (bits >> 1U) & kPairs;
  bits = (bits & kNibbles) + ((bits >> 2U) & kNibbles);
  return static_cast<std::uint32_t>((((bits + (bits >> 4U)) & kBytes) * kOnes) >> 56U);
}

}  // namespace

void WvSums::merge(const WvSums& other) {
  n_samples += other.n_samples;
  holes.merge(other.holes);
  if (levels.size() < other.levels.size()) levels.resize(other.levels.size());
  for (std::size_t i = 0; i < other.levels.size(); ++i) {
    levels[i].squares += other.levels[i].squares;
    levels[i].weight += other.levels[i].weight;
    levels[i].weight_squares += other.levels[i].weight_squares;
    levels[i].excess += other.levels[i].excess;
  }
}

WaveletVariance WvSums::wavelet_variance(double confidence) const {
  WaveletVariance wv;
  wv.n_samples = n_samples;
  wv.n_valid = n_samples;
  std::vector<MissingExcess> excess;
  for (std::size_t i = 0; i < levels.size(); ++i) {
    const Level& sums = levels[i];
    if (!(sums.weight > 0.0)) break;
    WvLevel level;
    level.level = static_cast<int>(i) + 1;
    level.tau_samples = std::ldexp(1.0, level.level);
    level.value = sums.squares / sums.weight;
    level.n_coefficients = static_cast<std::uint64_t>(
        std::llround(std::max(1.0, sums.weight * sums.weight / sums.weight_squares)));
    wv.levels.push_back(level);
    excess.push_back(sums.excess);
    excess.back() *= 1.0 / sums.weight;
  }
  take_out_missing(wv.levels, excess, holes);
  set_intervals(wv.levels, 1.0, confidence);
  return wv;
}

StreamingWv::StreamingWv(const StreamingOptions& options)
    : options_(options), keep_(1.0 - options.forgetting) {
  IMUSCOPE_EXPECTS(options.levels >= 1 && options.levels <= kMaxStreamingLevels);
  IMUSCOPE_EXPECTS(options.forgetting >= 0.0 && options.forgetting < 1.0);
  levels_.resize(static_cast<std::size_t>(options.levels));
  std::size_t offset = 0;
  std::size_t length = 1;
  for (Level& level : levels_) {
    level.offset = offset;
    level.mask = length - 1;
    offset += length;
    length *= 2;
  }
  rings_.assign(offset, 0.0);
  longest_ = offset + 1;
  words_.resize(std::bit_ceil(longest_ / kWordBits + 2));
}

void StreamingWv::reset() noexcept {
  for (Level& level : levels_) {
    level.squares = level.recent = level.weight = level.weight_squares = 0.0;
    level.excess = {};
  }
  holes_ = {};
  run_ = missing_ = 0;
  count_ = 0;
}

void StreamingWv::settle() noexcept {
  for (Level& level : levels_) {
    level.squares += level.recent;
    level.recent = 0.0;
  }
}

void StreamingWv::miss(std::uint64_t samples) noexcept {
  if (run_ > 0) missing_ += samples;
}

void StreamingWv::push(double x) noexcept {
  if (!std::isfinite(x)) {
    miss(1);
    return;
  }
  if (run_ == 0) {
    reference_ = x;
    words_[0] = {};
    whole_ = 0;
  }
  // Beyond the longest support nothing is left of what was before.
  if (missing_ > 0) whole_ = 0;
  for (std::uint64_t k = std::min(missing_, longest_); k > 0; --k) advance(0.0, false);
  holes_.add(missing_);
  missing_ = 0;
  ++whole_;
  advance(x - reference_, true);
  if (++count_ % kSettleEvery == 0) settle();
}

/// Valid samples before `position`.
std::uint32_t StreamingWv::valid_until(std::uint64_t position) const noexcept {
  const Word& word = words_[position / kWordBits & (words_.size() - 1)];
  const std::uint64_t before = (std::uint64_t{1} << position % kWordBits) - 1;
  return word.valid_before + valid_in(word.is_valid & before);
}

/// G-4. One position on: level by level, the sums of the n newest samples and of the n before them. A missing
/// sample adds nothing to the sums and nothing to the counts.
void StreamingWv::advance(double x, bool is_valid) noexcept {
  const std::uint64_t position = run_++;
  Word& word = words_[position / kWordBits & (words_.size() - 1)];
  if (is_valid) word.is_valid |= std::uint64_t{1} << position % kWordBits;
  empty_ = is_valid ? 0 : empty_ + 1;
  if (run_ % kWordBits == 0)
    words_[run_ / kWordBits & (words_.size() - 1)] = {0, word.valid_before + valid_in(word.is_valid)};
  double block = x;  // sum of the n newest samples, n = 1
  std::optional<Valid> valid;
  for (Level& level : levels_) {
    double& slot = rings_[level.offset + (position & level.mask)];
    const double before = slot;  // sum of the n samples before those
    slot = block;
    // The ring of the next level takes only complete sums.
    const std::uint64_t support = 2 * (static_cast<std::uint64_t>(level.mask) + 1);
    if (run_ < support) break;
    // Supports without a hole, which nearly all are at the lower levels, need no counts; nor do those whose
    // newer half is nothing but a hole, as they have no coefficient.
    if (support <= whole_) {
      add(level, (block - before) * (block - before));
    } else if (support / 2 > empty_) {
      if (!valid) valid = Valid{valid_until(run_), valid_until(run_ - support / 2)};
      add_of_valid(level, block, before, *valid);
    }
    block += before;
  }
}

/// @param valid  moved on to the next level
void StreamingWv::add_of_valid(Level& level, double newer, double older, Valid& valid) const noexcept {
  const std::uint64_t n = static_cast<std::uint64_t>(level.mask) + 1;
  const std::uint32_t oldest = valid_until(run_ - 2 * n);
  const std::uint32_t there_newer = valid.until_end - valid.until_middle;
  const std::uint32_t there_older = valid.until_middle - oldest;
  valid.until_middle = oldest;
  if (there_newer < least_valid(n) || there_older < least_valid(n)) return;
  const double difference = static_cast<double>(n) * (newer / there_newer - older / there_older);
  add(level, difference * difference);
  level.excess += missing_excess(n, there_older, there_newer);
}

void StreamingWv::add(Level& level, double square) const noexcept {
  if (keep_ < 1.0) {
    level.recent *= keep_;
    level.squares *= keep_;
    level.weight *= keep_;
    level.weight_squares *= keep_ * keep_;
    level.excess *= keep_;
  }
  level.recent += square;
  level.weight += 1.0;
  level.weight_squares += 1.0;
}

void StreamingWv::take(WvSums& out) noexcept {
  IMUSCOPE_EXPECTS(out.levels.size() == levels_.size());
  out.n_samples = count_;
  out.holes = holes_;
  double scale = 1.0;
  for (std::size_t i = 0; i < levels_.size(); ++i) {
    Level& level = levels_[i];
    scale *= 0.25;  // 1 / (2n)^2
    out.levels[i] = {(level.squares + level.recent) * scale, level.weight, level.weight_squares,
                     level.excess};
    level.squares = level.recent = level.weight = level.weight_squares = 0.0;
    level.excess = {};
  }
  holes_ = {};
  count_ = 0;
}

WvSums StreamingWv::sums() const {
  WvSums out;
  out.n_samples = count_;
  out.holes = holes_;
  double scale = 1.0;
  for (const Level& level : levels_) {
    scale *= 0.25;  // 1 / (2n)^2
    out.levels.push_back(
        {(level.squares + level.recent) * scale, level.weight, level.weight_squares, level.excess});
  }
  return out;
}

WaveletVariance StreamingWv::wavelet_variance() const { return sums().wavelet_variance(options_.confidence); }

WindowedWv::WindowedWv(int levels, std::uint64_t block_length, std::size_t blocks)
    : stream_({levels, 0.0, 0.95}), block_length_(block_length) {
  IMUSCOPE_EXPECTS(block_length >= 1 && blocks >= 1);
  blocks_.resize(blocks);
  for (WvSums& block : blocks_) block.levels.resize(static_cast<std::size_t>(levels));
}

bool WindowedWv::push(double x) noexcept {
  stream_.push(x);
  if (++in_block_ < block_length_) return false;
  in_block_ = 0;
  stream_.take(blocks_[next_]);
  next_ = (next_ + 1) % blocks_.size();
  return true;
}

WaveletVariance WindowedWv::wavelet_variance(double confidence) const {
  WvSums total;
  for (const WvSums& block : blocks_) total.merge(block);
  return total.wavelet_variance(confidence);
}

}  // namespace imuscope::noise
