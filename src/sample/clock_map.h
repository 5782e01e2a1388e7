#pragma once

/// Device time to host time. A device's own count (sample counter, time tag) spaces its samples far better
/// than their arrival does; what it lacks is an origin and an exact rate on the host's time scale. A clock
/// map learns both from arrivals that are late by an unknown, never negative amount.
///
/// Model: arrival = device_time + offset + skew * device_time + delay, delay >= 0. The map follows the lower
/// envelope of (arrival - device_time): late bytes, bursts and stalls lie above it and have no influence.
/// A constant latency of the stream stays in the mapped time; it is part of the time offset t_d.
///
/// Deterministic: the mapped times are a function of the observations alone. One map per device.

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "base/time.h"

namespace imuscope {

/// How a clock map finds its line.
struct ClockMapConfig {
  enum class Mode : std::uint8_t {
    kOnline,  ///< from the arrivals, as they come
    kFixed,   ///< given: time = origin + rate_ratio * device_time; arrivals are not looked at
  };
  Mode mode = Mode::kOnline;
  HostTime origin{};        ///< kFixed only: host time of device time 0
  double rate_ratio = 1.0;  ///< kFixed only: host seconds per device second, near 1

  /// For recordings without arrival stamps.
  static constexpr ClockMapConfig fixed(HostTime origin, double rate_ratio) noexcept {
    return {Mode::kFixed, origin, rate_ratio};
  }
};

/// Maps the device time of one device. Core: no allocation after construction, noexcept, bounded time per
/// call. Not thread-safe; trivially copyable.
class ClockMap {
 public:
  explicit ClockMap(const ClockMapConfig& config = {}) noexcept;

  /// Takes one observation and maps it. The mapped time never steps back: it is later than the mapped time of
  /// every observation before whenever device_time_ns is (equal where device_time_ns is equal).
  ///
  /// A device time that is less than the one before begins a new segment, as restart() does. So does one that
  /// arrives earlier than the line allows, or keeps arriving equally late for seconds of the device's and of
  /// the host's time: the device's clock jumped. A host that was away, for however long, leaves the line
  /// alone.
  ///
  /// @param device_time_ns  the device's time of the sample, unwrapped by the driver, any origin; |.| < 2^62
  /// @param first_byte      host time of the first byte of the sample's frame (upper bound: the read's
  ///                        arrival minus the time on the wire of the bytes from the first on)
  HostTime observe(std::int64_t device_time_ns, HostTime first_byte) noexcept;

  /// Forgets the line: the device restarted, or its count was not continuable. The rate is kept as a start.
  void restart() noexcept;

  /// True in mode kFixed, where a decoder derives sample.arrival = mapped time + time on the wire.
  [[nodiscard]] bool is_fixed() const noexcept { return config_.mode == ClockMapConfig::Mode::kFixed; }

  /// Device time per host time, minus 1, in parts per million: the device's clock is fast where positive.
  [[nodiscard]] double drift_ppm() const noexcept;

  /// How well the line is known: the scatter about it of the lowest observation of each two seconds. NaN
  /// before a rate was fitted in this segment, and in mode kFixed.
  [[nodiscard]] double scatter_s() const noexcept { return scatter_s_; }

  /// Segments begun after the first, by restart() or by the map itself.
  [[nodiscard]] std::uint64_t restarts() const noexcept { return restarts_; }

 private:
  /// The lowest observation of one interval of device time, relative to the segment's first observation.
  struct Point {
    double x_s;  ///< device time
    double y_s;  ///< host time minus device time
  };
  /// y = a + b x, in the coordinates of Point.
  struct Line {
    double a_s = 0.0;
    double b = 0.0;
    [[nodiscard]] double at(double x_s) const noexcept { return a_s + b * x_s; }
  };
  static constexpr std::size_t kBins = 256;

  void begin_segment(std::int64_t device_time_ns, HostTime first_byte) noexcept;
  [[nodiscard]] bool jumped(const Point& point, double residual_s) noexcept;
  void take(const Point& point) noexcept;
  void close_bin() noexcept;
  void refit() noexcept;
  [[nodiscard]] std::size_t lower_hull(std::array<Point, kBins>& hull) const noexcept;
  [[nodiscard]] Line hull_edge(const std::array<Point, kBins>& hull, std::size_t n) const noexcept;
  [[nodiscard]] double rate_near(const Line& line) const noexcept;
  [[nodiscard]] double scatter_about(const Line& line) const noexcept;
  [[nodiscard]] const Point& bin(std::size_t i) const noexcept { return bins_[(bins_begin_ + i) % kBins]; }
  void move_line(const Line& line, double x_s) noexcept;
  [[nodiscard]] HostTime emit(std::int64_t device_time_ns, double x_s, HostTime first_byte) noexcept;

  ClockMapConfig config_;
  std::uint64_t restarts_ = 0;

  // The segment: coordinates of Point are relative to its first observation.
  bool in_segment_ = false;
  std::int64_t device_origin_ns_ = 0;
  HostTime host_origin_{};
  Line line_;
  double scatter_s_ = std::numeric_limits<double>::quiet_NaN();
  double correction_s_ = 0.0;  ///< mapped time minus line; decays, so that a moved line makes no step

  // Lowest point of each closed interval, oldest first from bins_begin_, and of the open one.
  std::array<Point, kBins> bins_{};
  std::size_t bins_begin_ = 0;
  std::size_t bins_count_ = 0;
  Point open_bin_{};
  double open_bin_start_s_ = 0.0;
  bool open_bin_empty_ = true;

  // Suspicion that the device's clock jumped.
  int early_in_a_row_ = 0;
  double late_since_s_ = 0.0;       ///< device time
  double late_since_host_s_ = 0.0;  ///< host time since the segment's first observation
  double late_by_s_ = 0.0;
  bool late_ = false;

  // The last mapped observation.
  bool has_last_ = false;
  std::int64_t last_device_ns_ = 0;
  HostTime last_mapped_{};
};

}  // namespace imuscope
