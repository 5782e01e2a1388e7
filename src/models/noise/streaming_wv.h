#pragma once

/// Haar wavelet variance of a signal as it arrives: O(levels) a sample, no allocation after construction,
/// equal to the batch result over the same samples, with those that are missing. Memory: 2^levels doubles
/// and a few per cent more (16 levels: 544 KiB).

#include <cstdint>
#include <vector>

#include "models/noise/wavelet_variance.h"

namespace imuscope::noise {

/// How many levels a stream keeps, and how long it remembers.
struct StreamingOptions {
  int levels = 16;  ///< 1..24
  /// Share of its weight that a coefficient loses with each one after it at its level, in [0, 1): 0 keeps all
  /// for ever; 1/n forgets with a time constant of n samples. The counts then are effective ones, (sum w)^2 /
  /// (sum w^2).
  double forgetting = 0.0;
  double confidence = 0.95;
};

/// Sums that a wavelet variance is made of; two of them (other stretches, other replicates) can be merged.
struct WvSums {
  /// Sums of one level, over its coefficients W and their weights w.
  struct Level {
    double squares = 0.0;         ///< sum of w W^2
    double weight = 0.0;          ///< sum of w
    double weight_squares = 0.0;  ///< sum of w^2
    MissingExcess excess{};       ///< sum of w missing_excess()
  };
  std::uint64_t n_samples = 0;
  std::vector<Level> levels;
  HoleLengths holes;

  /// Adds the coefficients of another stretch. What would span the join is in neither, as at a gap.
  void merge(const WvSums& other);
  /// Levels with at least one coefficient, with their intervals.
  [[nodiscard]] WaveletVariance wavelet_variance(double confidence = 0.95) const;
};

class StreamingWv {
 public:
  explicit StreamingWv(const StreamingOptions& options = {});

  /// Next sample. A value that is not finite counts as missing. Allocates: never. Not thread-safe.
  void push(double x) noexcept;
  /// So many samples are missing here, lost or of another regime. They count when the next one comes.
  void miss(std::uint64_t samples) noexcept;
  /// What comes has nothing to do with what was: no coefficient spans this place.
  void gap() noexcept { run_ = missing_ = 0; }
  /// Forgets everything, keeps the options.
  void reset() noexcept;

  [[nodiscard]] WvSums sums() const;
  /// Hands out the sums since the last call and starts new ones; coefficients go on spanning the samples
  /// before. Precondition: out has this stream's number of levels. Allocates: never.
  void take(WvSums& out) noexcept;
  [[nodiscard]] WaveletVariance wavelet_variance() const;

 private:
  struct Level {
    double squares = 0.0;  ///< settled part of the sum of (2n W)^2
    double recent = 0.0;   ///< part since the last settling, so that long sums keep their digits
    double weight = 0.0;
    double weight_squares = 0.0;
    MissingExcess excess{};
    std::size_t offset = 0;  ///< of this level's ring in rings_
    std::size_t mask = 0;    ///< ring length - 1
  };

  void advance(double x, bool is_valid) noexcept;
  [[nodiscard]] std::uint32_t valid_until(std::uint64_t position) const noexcept;
  /// Valid samples before the end and before the middle of a level's support.
  struct Valid {
    std::uint32_t until_end;
    std::uint32_t until_middle;
  };
  void add_of_valid(Level& level, double newer, double older, Valid& valid) const noexcept;
  void add(Level& level, double square) const noexcept;
  void settle() noexcept;

  StreamingOptions options_;
  double keep_ = 1.0;
  std::vector<Level> levels_;
  std::vector<double> rings_;  ///< for each level the sums of n = 2^(level-1) samples, the last n of them
  /// Which positions hold a valid sample, one bit each, and how many did before each word, modulo 2^32: a
  /// ring that is longer than the longest support by a word at least.
  struct Word {
    std::uint64_t is_valid = 0;
    std::uint32_t valid_before = 0;
  };
  std::vector<Word> words_;
  std::uint64_t longest_ = 0;  ///< support: 2^levels
  HoleLengths holes_;
  double reference_ = 0.0;
  std::uint64_t run_ = 0;      ///< positions since the last gap
  std::uint64_t missing_ = 0;  ///< positions that wait for the next sample
  std::uint64_t whole_ = 0;    ///< positions since the last missing sample
  std::uint64_t empty_ = 0;    ///< positions since the last valid sample
  std::uint64_t count_ = 0;    ///< samples taken
};

/// The wavelet variance of the last `blocks` blocks of `block_length` samples: a sliding window that moves by
/// a block. Coefficients belong to the block in which they end, so none is lost where blocks meet.
class WindowedWv {
 public:
  /// Precondition: block_length >= 1, blocks >= 1.
  WindowedWv(int levels, std::uint64_t block_length, std::size_t blocks);

  /// Allocates: never. True when this sample completed a block.
  bool push(double x) noexcept;
  void miss(std::uint64_t samples) noexcept { stream_.miss(samples); }
  void gap() noexcept { stream_.gap(); }

  /// Over the complete blocks of the window.
  [[nodiscard]] WaveletVariance wavelet_variance(double confidence = 0.95) const;

 private:
  StreamingWv stream_;
  std::uint64_t block_length_;
  std::uint64_t in_block_ = 0;
  std::vector<WvSums> blocks_;
  std::size_t next_ = 0;
};

}  // namespace imuscope::noise
