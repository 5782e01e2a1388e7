#pragma once

/// The Haar coefficients of a signal, level by level, from dyadic block sums: of one run of samples, or of
/// many with missing samples between them.
///
/// Block sums (never prefix sums) keep the rounding error relative to the run's own variation: the first
/// sample is subtracted before anything is added, so a large constant offset costs nothing.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace imuscope::noise {

/// A run of valid samples, [begin, end).
struct Segment {
  std::size_t begin = 0;
  std::size_t end = 0;

  bool operator==(const Segment&) const = default;
};

/// Samples that half a support of n samples needs: an eighth of them may be missing. More than that, and what
/// the half stands for is another stretch of time; less would lose the slow levels to a few lost samples.
/// Below n = 8 none may be missing.
constexpr std::size_t least_valid(std::size_t n) noexcept { return n - n / 8; }

/// What missing samples add to the expected square of a coefficient, in units of variances within its halves
/// (G-33): each hole its own, less what all of a half have in common.
struct MissingExcess {
  double own = 0.0;
  double common = 0.0;

  MissingExcess& operator+=(const MissingExcess& more) noexcept {
    own += more.own;
    common += more.common;
    return *this;
  }
  MissingExcess& operator*=(double factor) noexcept {
    own *= factor;
    common *= factor;
    return *this;
  }
};

/// @param n  samples of half the support, of which `older` and `newer` are there
MissingExcess missing_excess(std::size_t n, std::size_t older, std::size_t newer) noexcept;

/// How long the holes of a record are, by powers of two.
class HoleLengths {
 public:
  void add(std::uint64_t missing) noexcept;
  void merge(const HoleLengths& other) noexcept;
  /// What the holes add to a square, by G-33.
  /// @param below  wavelet variances of the levels below the support's: n = 2^below.size()
  [[nodiscard]] double variance_of(const MissingExcess& excess, std::span<const double> below) const noexcept;

 private:
  static constexpr std::size_t kScales = 40;
  std::array<double, kScales> samples_{};
  std::array<double, kScales> holes_{};
};

/// Sum of squared coefficients and their count at one level.
struct LevelSum {
  double sum_of_squares = 0.0;
  std::uint64_t count = 0;
};

/// floor(log2(length)): the highest level with at least one coefficient in a run of that length; 0 below 2.
int highest_level(std::size_t length) noexcept;

/// Adds the run's squared coefficients to `sums` (index 0 = level 1), as far as the run is long enough.
/// Memory: one copy of the run.
void add_squares(std::span<const double> run, std::span<LevelSum> sums);

/// The same without the copy: `run` is used up.
void add_squares_in_place(std::span<double> run, std::span<LevelSum> sums);

/// Sum of squares, the order of its additions a part of the result: four sums side by side, those of even and of
/// odd places brought together at the end.
class SquareSum {
 public:
  void add(double value) noexcept {
    squares_[count_ % kSideBySide] = value * value;
    if (++count_ % kSideBySide != 0) return;
    for (std::size_t i = 0; i < kSideBySide; ++i) sums_[i] += squares_[i];
  }
  /// One after the other.
  void add(std::span<const double> values) noexcept;
  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }
  /// Precondition: one at least.
  [[nodiscard]] double mean() const noexcept;

 private:
  static constexpr std::size_t kSideBySide = 4;
  std::array<double, kSideBySide> sums_{};
  std::array<double, kSideBySide> squares_{};  ///< not added yet, as many as are beyond the last four
  std::uint64_t count_ = 0;
};

/// Walks the levels of one run, or of several with missing samples between them, and hands out the
/// coefficients themselves: half the difference of the means of the samples that are there.
class HaarLevels {
 public:
  /// Takes a copy of the samples. Precondition: at least one run, in order, without overlap.
  HaarLevels(std::span<const double> x, std::span<const Segment> runs);
  /// Works in the memory of `x`, which is used up and has to stay.
  static HaarLevels in_place(std::span<double> x, std::span<const Segment> runs);
  HaarLevels(HaarLevels&&) noexcept = default;
  HaarLevels& operator=(HaarLevels&&) noexcept = default;
  HaarLevels(const HaarLevels&) = delete;
  HaarLevels& operator=(const HaarLevels&) = delete;
  ~HaarLevels() = default;

  /// Computes the next level into `coefficients` (appended). False when there is none at it.
  /// @param excess  the sum of missing_excess() over them is added
  /// @param places  of several runs: the stretches of the coefficients' newest samples are appended
  bool append_next(std::vector<double>& coefficients, MissingExcess& excess, std::vector<Segment>& places);
  /// The same where their squares are all that is wanted. Of several runs.
  bool add_next(SquareSum& squares, MissingExcess& excess, std::vector<Segment>& places);

 private:
  HaarLevels(std::span<const Segment> runs, std::size_t begin);
  void begin_with(std::span<const double> x, std::span<double> memory);
  [[nodiscard]] std::size_t half() const { return std::size_t{1} << static_cast<unsigned>(level_); }
  [[nodiscard]] bool has_next() const { return blocks_.size() >= half() + 1; }
  void end_level();
  void append_whole(std::size_t n, std::vector<double>& coefficients);
  struct Halves;
  static constexpr std::size_t kTogether = 1024;  ///< coefficients that are made in one go
  template <typename Take>
  void take_stretch(std::size_t n, std::size_t s, std::size_t length, Halves& halves, const Take& take,
                    MissingExcess& excess, std::vector<Segment>& places);
  template <typename Take>
  void take_valid(std::size_t n, const Take& take, MissingExcess& excess, std::vector<Segment>& places);

  std::size_t begin_;
  std::vector<Segment> runs_;  ///< from begin_ on
  std::vector<double> copy_;   ///< empty where the samples' own memory is used
  std::span<double> blocks_;   ///< sums of 2^level_ neighbouring samples, missing ones as zero
  int level_ = 0;
};

}  // namespace imuscope::noise
