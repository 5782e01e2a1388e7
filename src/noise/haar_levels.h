#pragma once

/// The Haar coefficients of one run of samples, level by level, from dyadic block sums.
///
/// Block sums (never prefix sums) keep the rounding error relative to the run's own variation: the first
/// sample is subtracted before anything is added, so a large constant offset costs nothing.

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace imuscope::noise {

/// Sum of squared coefficients and their count at one level.
struct LevelSum {
  double sum_of_squares = 0.0;
  std::uint64_t count = 0;
};

/// floor(log2(length)): the highest level with at least one coefficient in a run of that length; 0 below 2.
int highest_level(std::size_t length) noexcept;

/// Adds the run's squared coefficients to `sums` (index 0 = level 1), as far as the run is long enough.
/// `work` is scratch; it grows to the run's length.
void add_squares(std::span<const double> run, std::span<LevelSum> sums, std::vector<double>& work);

/// Walks the levels of one run and hands out the coefficients themselves.
class HaarLevels {
 public:
  explicit HaarLevels(std::span<const double> run);
  /// Computes the next level into `coefficients` (appended). False when the run is too short for it.
  bool append_next(std::vector<double>& coefficients);

 private:
  std::vector<double> blocks_;  ///< sums of 2^level_ neighbouring samples, by the oldest one's index
  int level_ = 0;
};

}  // namespace imuscope::noise
