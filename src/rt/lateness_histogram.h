#pragma once

/// How late things were: a histogram of durations that costs a fixed 2.3 kB and a few instructions a value.

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "base/time.h"

namespace imuscope {

/// Log-linear histogram: 8 buckets an octave from 1 ns, so a quantile is at most 1/8 above the true one and
/// never below it. Durations from 2^36 ns (69 s) share the last bucket; the maximum is exact. Trivially
/// copyable, to cross a LatestValue. Allocates: never. Thread: one at a time.
class LatenessHistogram {
 public:
  /// A negative duration (early) counts as zero.
  void add(Duration duration) noexcept {
    const Duration late = std::max(duration, Duration::zero());
    counts_[bucket_of(static_cast<std::uint64_t>(late.count()))] += 1;
    count_ += 1;
    max_ = std::max(max_, late);
  }

  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }
  [[nodiscard]] Duration max() const noexcept { return max_; }

  /// Smallest bucket edge that at least the share p of the values does not exceed; zero when empty.
  /// @param p in (0, 1], e.g. 0.999
  [[nodiscard]] Duration quantile(double p) const noexcept {
    const auto wanted = static_cast<std::uint64_t>(std::ceil(p * static_cast<double>(count_)));
    std::uint64_t seen = 0;
    for (std::size_t bucket = 0; bucket < kBuckets; ++bucket) {
      seen += counts_[bucket];
      if (seen >= wanted && seen > 0) return std::min(max_, upper_edge(bucket));
    }
    return max_;
  }

  /// Values per octave, for a picture: the first counts values below 1.024 us, element i > 0 those from
  /// 1.024 us * 2^(i-1) to below 1.024 us * 2^i, the last one everything beyond.
  static constexpr std::size_t kOctaves = 18;
  [[nodiscard]] std::array<std::uint64_t, kOctaves> octaves() const noexcept {
    std::array<std::uint64_t, kOctaves> octaves{};
    for (std::size_t bucket = 0; bucket < kBuckets; ++bucket) {
      const auto edge_ns = static_cast<std::uint64_t>(upper_edge(bucket).count());
      const auto octave = static_cast<std::size_t>(std::bit_width(edge_ns >> kOctaveShift));
      octaves[std::min(octave, kOctaves - 1)] += counts_[bucket];
    }
    return octaves;
  }

 private:
  static constexpr unsigned kOctaveShift = 10;  // 1.024 us in ns
  static constexpr unsigned kSubBits = 3;
  static constexpr std::uint64_t kSubBuckets = 1U << kSubBits;
  static constexpr unsigned kTopBit = 36;
  static constexpr std::size_t kBuckets = (kTopBit - kSubBits + 1) * kSubBuckets;

  // Values below 8 have a bucket each; above, the leading bit picks the octave and the next three the bucket.
  static constexpr std::size_t bucket_of(std::uint64_t ns) noexcept {
    if (ns < kSubBuckets) return static_cast<std::size_t>(ns);
    const auto octave = static_cast<unsigned>(std::bit_width(ns)) - 1;
    if (octave >= kTopBit) return kBuckets - 1;
    const unsigned shift = octave - kSubBits;
    return static_cast<std::size_t>((shift + 1) * kSubBuckets + ((ns >> shift) & (kSubBuckets - 1)));
  }
  static constexpr Duration upper_edge(std::size_t bucket) noexcept {
    if (bucket < kSubBuckets) return Duration{static_cast<std::int64_t>(bucket)};
    if (bucket == kBuckets - 1) return Duration::max();
    const std::uint64_t shift = bucket / kSubBuckets - 1;
    const std::uint64_t first = (kSubBuckets + bucket % kSubBuckets) << shift;
    return Duration{static_cast<std::int64_t>(first + (std::uint64_t{1} << shift) - 1)};
  }

  std::array<std::uint64_t, kBuckets> counts_{};
  std::uint64_t count_ = 0;
  Duration max_{0};
};

}  // namespace imuscope
