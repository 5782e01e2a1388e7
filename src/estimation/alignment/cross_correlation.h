#pragma once

/// Brings the clocks of two IMUs on one body together by content: |omega| is the same in any mounting, so the
/// shift at which two series of it match is the time offset. in EQUATIONS.md.

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "base/result.h"
#include "base/time.h"

namespace imuscope {

/// |omega| over time. Times rise; the rate may be uneven.
struct RateMagnitudeSeries {
  std::span<const double> time_s;
  std::span<const double> rate_radps;
};

/// How far apart the clocks may be, and whether their rates may differ.
struct TimeOffsetOptions {
  double search_s = 30.0;           ///< offsets from -search_s to +search_s are tried
  bool estimate_clock_rate = true;  ///< where the overlap is long enough (two minutes or more)
};

/// reference time = study time * (1 + clock_rate) + offset_s, with the study time counted from
/// study_origin_s: t_R = t_S + offset_s + clock_rate * (t_S - study_origin_s). A positive offset is added to
/// the study time.
struct TimeOffset {
  double offset_s = 0.0;
  double clock_rate = 0.0;  ///< s/s; 0 where not estimated
  double study_origin_s = 0.0;
  double correlation = 0.0;   ///< at the peak, 0 to 1
  double distinctness = 0.0;  ///< peak over the highest correlation away from the peak; > 1.2 is safe
  double sd_s = 0.0;          ///< of offset_s
  bool clock_rate_estimated = false;
};

/// Non-real-time: allocates. Fails, with the reason, where the series do not overlap, hold too little motion
/// or do not resemble one another.
[[nodiscard]] Result<TimeOffset> find_time_offset(const RateMagnitudeSeries& reference,
                                                  const RateMagnitudeSeries& study,
                                                  const TimeOffsetOptions& options = {});

/// The same on a live stream, within +-2 s, from the last 20 s. Core: fixed memory (about 150 kB: make it a
/// member of something that lives on the heap or is static), no allocation, noexcept. Thread: owner only.
class LiveTimeOffset {
 public:
  /// Samples closer than 8 ms to the one before are left out; times that do not rise are ignored.
  void add_reference(HostTime time, double rate_radps) noexcept { reference_.add(time, rate_radps); }
  void add_study(HostTime time, double rate_radps) noexcept { study_.add(time, rate_radps); }

  /// Offset to add to the study time. Costs a few tenths of a millisecond: ask now and then, not every tick.
  /// @return false where there is not enough data or motion, or no clear peak; `out` is then untouched
  [[nodiscard]] bool estimate(TimeOffset& out) noexcept;

 private:
  static constexpr std::size_t kMaxLag = 100;     ///< +-2 s of grid steps
  static constexpr std::size_t kGridSize = 1000;  ///< 20 s
  static constexpr std::size_t kSamples = 4096;

  /// The last kSamples of one stream.
  struct Stream {
    void add(HostTime time, double rate) noexcept;
    [[nodiscard]] HostTime newest() const noexcept;
    /// Linear interpolation at start + i * step; false where the stream does not cover that.
    [[nodiscard]] bool sample_onto(HostTime start, Duration step, std::span<double> grid) const noexcept;
    std::array<HostTime, kSamples> time{};
    std::array<double, kSamples> rate{};
    std::size_t count = 0;  ///< ever added
  };

  Stream reference_;
  Stream study_;
  std::array<double, kGridSize + 2 * kMaxLag> reference_grid_{};
  std::array<double, kGridSize> study_grid_{};
  std::array<double, 2 * kMaxLag + 1> correlation_{};
};

}  // namespace imuscope
