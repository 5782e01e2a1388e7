#include "models/noise/haar_levels.h"

#include <Eigen/Core>
#include <algorithm>
#include <bit>
#include <cmath>

namespace imuscope::noise {
namespace {

using Array = Eigen::Map<Eigen::ArrayXd>;

Array stretch(std::span<double> blocks, std::size_t at, std::size_t length) {
  return {blocks.data() + at, static_cast<Eigen::Index>(length)};
}

/// Whether samples are there, asked in the order of their places.
class Presence {
 public:
  explicit Presence(const std::vector<Segment>& runs) : run_(runs.begin()), end_(runs.end()) {}

  bool at(std::size_t i) {
    while (run_ != end_ && run_->end <= i) ++run_;
    return run_ != end_ && run_->begin <= i;
  }

 private:
  std::vector<Segment>::const_iterator run_;
  std::vector<Segment>::const_iterator end_;
};

/// How many of the samples [begin, end) are there.
std::size_t count_of(const std::vector<Segment>& runs, std::size_t begin, std::size_t end) {
  std::size_t count = 0;
  for (const Segment& run : runs) {
    const std::size_t first = std::max(run.begin, begin);
    const std::size_t last = std::min(run.end, end);
    if (first < last) count += last - first;
  }
  return count;
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

double SquareSum::mean() const noexcept {
  const std::size_t left = count_ % kSideBySide;
  double even = sums_[0] + sums_[2];
  double odd = sums_[1] + sums_[3];
  if (left >= 2) {
    even += squares_[0];
    odd += squares_[1];
  }
  double sum = even + odd;
  if (left % 2 == 1) sum += squares_[left - 1];
  return sum / static_cast<double>(count_);
}

HaarLevels::HaarLevels(std::span<const Segment> runs, std::size_t begin)
    : begin_(begin), runs_(runs.begin(), runs.end()) {
  for (Segment& run : runs_) run = {run.begin - begin, run.end - begin};
}

HaarLevels::HaarLevels(std::span<const double> x, std::span<const Segment> runs)
    : HaarLevels(runs, runs.front().begin) {
  copy_.resize(runs_.back().end);
  begin_with(x.subspan(begin_, copy_.size()), copy_);
}

HaarLevels HaarLevels::in_place(std::span<double> x, std::span<const Segment> runs) {
  HaarLevels levels(runs, runs.front().begin);
  const std::span<double> used = x.subspan(levels.begin_, levels.runs_.back().end);
  levels.begin_with(used, used);
  return levels;
}

/// @param memory  as long as x, or the same
void HaarLevels::begin_with(std::span<const double> x, std::span<double> memory) {
  blocks_ = memory;
  const double first = x.front();
  std::size_t end = 0;
  for (const Segment& run : runs_) {
    std::fill(memory.begin() + static_cast<std::ptrdiff_t>(end),
              memory.begin() + static_cast<std::ptrdiff_t>(run.begin), 0.0);
    for (std::size_t i = run.begin; i < run.end; ++i) memory[i] = x[i] - first;
    end = run.end;
  }
}

void HaarLevels::append_whole(std::size_t n, std::vector<double>& coefficients) {
  const std::size_t count = blocks_.size() - n;
  const double scale = 0.5 / static_cast<double>(n);
  const std::size_t had = coefficients.size();
  coefficients.resize(had + count);
  stretch(coefficients, had, count) = (stretch(blocks_, n, count) - stretch(blocks_, 0, count)) * scale;
  stretch(blocks_, 0, count) += stretch(blocks_, n, count);
}

template <typename Take>
void HaarLevels::take_valid(std::size_t n, const Take& take, MissingExcess& excess,
                            std::vector<Segment>& places) {
  const std::size_t count = blocks_.size() - n;
  const std::size_t least = least_valid(n);
  std::size_t older = count_of(runs_, 0, n);
  std::size_t newer = count_of(runs_, n, 2 * n);
  Presence leaves(runs_);
  Presence passes(runs_);
  Presence comes(runs_);
  for (std::size_t s = 0; s < count; ++s) {
    if (older >= least && newer >= least) {
      take(0.5 * (blocks_[s + n] / static_cast<double>(newer) - blocks_[s] / static_cast<double>(older)));
      excess += missing_excess(n, older, newer);
      const std::size_t newest = begin_ + s + 2 * n - 1;
      if (places.empty() || places.back().end != newest) places.push_back({newest, newest});
      ++places.back().end;
    }
    blocks_[s] += blocks_[s + n];
    const std::size_t between = passes.at(s + n) ? 1 : 0;
    older = older + between - (leaves.at(s) ? 1 : 0);
    newer = newer + (comes.at(s + 2 * n) ? 1 : 0) - between;
  }
}

void HaarLevels::end_level() {
  blocks_ = blocks_.first(blocks_.size() - half());
  ++level_;
}

bool HaarLevels::append_next(std::vector<double>& coefficients, MissingExcess& excess,
                             std::vector<Segment>& places) {
  if (!has_next()) return false;
  const std::size_t had = coefficients.size();
  if (runs_.size() == 1)
    append_whole(half(), coefficients);
  else
    take_valid(
        half(), [&](double coefficient) { coefficients.push_back(coefficient); }, excess, places);
  end_level();
  return coefficients.size() > had;
}

bool HaarLevels::add_next(SquareSum& squares, MissingExcess& excess, std::vector<Segment>& places) {
  if (!has_next()) return false;
  const std::uint64_t had = squares.count();
  take_valid(
      half(), [&](double coefficient) { squares.add(coefficient); }, excess, places);
  end_level();
  return squares.count() > had;
}

}  // namespace imuscope::noise
