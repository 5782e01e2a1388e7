#include "models/noise/haar_levels.h"

#include <Eigen/Core>
#include <bit>
#include <cmath>
#include <numeric>

namespace imuscope::noise {
namespace {

using Array = Eigen::Map<Eigen::ArrayXd>;

Array stretch(std::vector<double>& blocks, std::size_t at, std::size_t length) {
  return {blocks.data() + at, static_cast<Eigen::Index>(length)};
}

void subtract_first(std::span<const double> run, std::vector<double>& out) {
  out.resize(run.size());
  const Eigen::Map<const Eigen::ArrayXd> in(run.data(), static_cast<Eigen::Index>(run.size()));
  stretch(out, 0, out.size()) = in - run.front();
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
