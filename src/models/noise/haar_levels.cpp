#include "models/noise/haar_levels.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

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

  std::size_t at(std::size_t i) {
    while (run_ != end_ && run_->end <= i) ++run_;
    return run_ != end_ && run_->begin <= i ? 1 : 0;
  }
  /// The next place of which at() says something else than of the one it was asked last.
  [[nodiscard]] std::size_t until(std::size_t i) const {
    if (run_ == end_) return std::numeric_limits<std::size_t>::max();
    return run_->begin <= i ? run_->end : run_->begin;
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

void SquareSum::add(std::span<const double> values) noexcept {
  std::size_t i = 0;
  while (i < values.size() && count_ % kSideBySide != 0) add(values[i++]);
  for (; i + kSideBySide <= values.size(); i += kSideBySide) {
    for (std::size_t k = 0; k < kSideBySide; ++k) sums_[k] += values[i + k] * values[i + k];
    count_ += kSideBySide;
  }
  while (i < values.size()) add(values[i++]);
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

/// How many samples two halves of a support have, and by how many that changes from place to place.
struct HaarLevels::Halves {
  std::size_t older = 0;
  std::size_t newer = 0;
  std::ptrdiff_t older_grows = 0;
  std::ptrdiff_t newer_grows = 0;

  [[nodiscard]] bool grow() const { return older_grows != 0 || newer_grows != 0; }
  void step() {
    older += static_cast<std::size_t>(older_grows);
    newer += static_cast<std::size_t>(newer_grows);
  }
};

/// Coefficients of `length` places from `s` on, between which samples neither come nor go at the ends of the halves but
/// as the halves say. Leaves them as they are after that.
template <typename Take>
void HaarLevels::take_stretch(std::size_t n, std::size_t s, std::size_t length, Halves& halves,
                              const Take& take, MissingExcess& excess, std::vector<Segment>& places) {
  const std::size_t least = least_valid(n);
  const auto take_some = [&](std::size_t at, std::size_t some) {
    if (halves.older < least || halves.newer < least) return;
    std::array<double, kTogether> coefficients;
    Eigen::Map<Eigen::ArrayXd>(coefficients.data(), static_cast<Eigen::Index>(some)) =
        0.5 * (stretch(blocks_, at + n, some) / static_cast<double>(halves.newer) -
               stretch(blocks_, at, some) / static_cast<double>(halves.older));
    take(std::span<const double>(coefficients.data(), some));
    const MissingExcess of_each = missing_excess(n, halves.older, halves.newer);
    if (of_each.own != 0.0) {
      for (std::size_t i = 0; i < some; ++i) excess += of_each;
    }
    const std::size_t newest = begin_ + at + 2 * n - 1;
    if (places.empty() || places.back().end != newest) places.push_back({newest, newest});
    places.back().end += some;
  };
  const std::size_t together = halves.grow() ? 1 : kTogether;
  for (std::size_t at = s; at < s + length; at += together) {
    const std::size_t some = std::min(together, s + length - at);
    take_some(at, some);
    stretch(blocks_, at, some) += stretch(blocks_, at + n, some);
    halves.step();
  }
}

template <typename Take>
void HaarLevels::take_valid(std::size_t n, const Take& take, MissingExcess& excess,
                            std::vector<Segment>& places) {
  const std::size_t count = blocks_.size() - n;
  Halves halves{count_of(runs_, 0, n), count_of(runs_, n, 2 * n)};
  Presence leaves(runs_);
  Presence passes(runs_);
  Presence comes(runs_);
  for (std::size_t s = 0; s < count;) {
    const auto leaving = static_cast<std::ptrdiff_t>(leaves.at(s));
    const auto passing = static_cast<std::ptrdiff_t>(passes.at(s + n));
    const auto coming = static_cast<std::ptrdiff_t>(comes.at(s + 2 * n));
    halves.older_grows = passing - leaving;
    halves.newer_grows = coming - passing;
    const std::size_t end =
        std::min({leaves.until(s), passes.until(s + n) - n, comes.until(s + 2 * n) - 2 * n, count});
    take_stretch(n, s, end - s, halves, take, excess, places);
    s = end;
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
        half(),
        [&](std::span<const double> some) {
          coefficients.insert(coefficients.end(), some.begin(), some.end());
        },
        excess, places);
  end_level();
  return coefficients.size() > had;
}

bool HaarLevels::add_next(SquareSum& squares, MissingExcess& excess, std::vector<Segment>& places) {
  if (!has_next()) return false;
  const std::uint64_t had = squares.count();
  take_valid(
      half(), [&](std::span<const double> some) { squares.add(some); }, excess, places);
  end_level();
  return squares.count() > had;
}

}  // namespace imuscope::noise
