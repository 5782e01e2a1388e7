#pragma once

/// Long signals for a small page: the smallest, mean, largest and last value of each stretch of time. The
/// stretches start short and double in length whenever there would be too many, so that memory is bounded
/// whatever the length of the record. Stretches without a sample stay empty: a gap is shown as a gap.

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace imuscope::report {

class BinnedSignals {
 public:
  /// One signal in one stretch of time; NaN and infinities stand there while `n` is zero.
  struct Bin {
    double smallest = std::numeric_limits<double>::infinity();
    double largest = -std::numeric_limits<double>::infinity();
    double sum = 0.0;
    double last = std::numeric_limits<double>::quiet_NaN();
    std::uint64_t n = 0;

    [[nodiscard]] double mean() const { return sum / static_cast<double>(n); }
  };

  /// @param n_signals   signals that share their times
  /// @param n_bins_max  even, at least 2; between half of it and all of it are in use for a long record
  /// @param width_s     length of the stretches to begin with, above zero
  BinnedSignals(std::size_t n_signals, std::size_t n_bins_max, double width_s);

  /// Adds one sample of every signal. A NaN leaves that signal's stretch as it was. Times before the first
  /// one count to the first stretch; times that are not finite are ignored.
  void add(double time_s, std::span<const double> values);
  /// To be called after the last sample: lengthens the stretches until those in use hold two samples on
  /// average, so that a slow signal does not look like one of gaps.
  void coarsen();

  [[nodiscard]] std::size_t size() const { return n_used_; }
  [[nodiscard]] double width_s() const { return width_s_; }
  /// Middle of stretch `i`.
  [[nodiscard]] double time_s(std::size_t i) const {
    return begin_s_ + (static_cast<double>(i) + 0.5) * width_s_;
  }
  [[nodiscard]] const Bin& bin(std::size_t signal, std::size_t i) const { return bins_[signal][i]; }

 private:
  void double_width();

  std::vector<std::vector<Bin>> bins_;  ///< by signal
  std::vector<std::uint64_t> n_added_;  ///< samples by stretch
  std::size_t n_bins_max_;
  std::size_t n_used_ = 0;
  double width_s_;
  double begin_s_ = std::numeric_limits<double>::quiet_NaN();
};

}  // namespace imuscope::report
