#pragma once

/// The instants at which a device samples, and what its own clock says then. The two agree until the clock
/// runs fast or slow, or jumps.

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace imusim {

class SampleGrid {
 public:
  /// @param first_s   instant of sample 0, on both clocks
  /// @param period_s  between samples, by the device's clock
  /// @param skew_ppm  positive: the device's clock is fast, so it samples more often
  SampleGrid(double first_s, double period_s, double skew_ppm = 0.0)
      : instant_s_(first_s), device_s_(first_s), period_s_(period_s), skew_(skew_ppm * 1e-6) {}

  /// Instant of a sample, in the scenario's time.
  [[nodiscard]] double instant(std::int64_t index) const {
    return instant_s_ + static_cast<double>(index - index_) * real_period();
  }
  /// The same by the device's clock.
  [[nodiscard]] double device_time(std::int64_t index) const {
    return device_s_ + static_cast<double>(index - index_) * period_s_;
  }
  [[nodiscard]] double period() const { return period_s_; }
  [[nodiscard]] double skew_ppm() const { return skew_ * 1e6; }

  /// First sample at or after an instant, not before sample 0.
  [[nodiscard]] std::int64_t first_from(double t_s) const {
    const double ahead = std::ceil((t_s - instant_s_) / real_period());
    return std::max<std::int64_t>(0, index_ + static_cast<std::int64_t>(ahead));
  }

  /// From sample `index` on, which keeps its instant.
  void set_period(double period_s, std::int64_t index) {
    anchor(index);
    period_s_ = period_s;
  }
  void set_skew(double skew_ppm, std::int64_t index) {
    anchor(index);
    skew_ = skew_ppm * 1e-6;
  }
  /// The device's clock is put ahead (or back).
  void jump(double by_s) { device_s_ += by_s; }

 private:
  [[nodiscard]] double real_period() const { return period_s_ / (1.0 + skew_); }
  void anchor(std::int64_t index) {
    const double instant_there_s = instant(index);
    device_s_ = device_time(index);
    instant_s_ = instant_there_s;
    index_ = index;
  }

  std::int64_t index_ = 0;
  double instant_s_;
  double device_s_;
  double period_s_;
  double skew_;
};

}  // namespace imusim
