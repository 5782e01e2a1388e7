#pragma once

/// One low-pass for errors and prediction alike, so that two sensors whose bandwidths differ are compared
/// where both see: the error is linear in sample and prediction, so filtering it filters both. The dynamics
/// that the error is studied against pass the same filter. Equation numbers P-4 in EQUATIONS.md.

#include <array>
#include <cstddef>
#include <cstdint>

#include "estimation/error_process/error_row.h"

namespace imuscope {

/// Second-order Butterworth, causal: S samples keep their instants, everything is delayed alike. Begins anew
/// after a missing sample and an invalid triad; until it has settled the rows are not valid.
class RowLowPass {
 public:
  /// Precondition: 0 < corner_hz < rate_hz / 2.
  RowLowPass(double rate_hz, double corner_hz);

  /// Filters the next row in place, in the order of the counters.
  void apply(ErrorRow& row) noexcept;

 private:
  /// Errors, prediction and its derivatives of one triad.
  static constexpr std::size_t kSignals = 21;
  struct Triad {
    std::array<double, kSignals> x1{};
    std::array<double, kSignals> x2{};
    std::array<double, kSignals> y1{};
    std::array<double, kSignals> y2{};
    std::int64_t run = 0;  ///< samples since it began anew
  };
  void begin(Triad& triad, const std::array<double, kSignals>& x) noexcept;
  void step(Triad& triad, std::array<double, kSignals>& x) const noexcept;

  double b0_ = 0.0;
  double b1_ = 0.0;
  double a1_ = 0.0;
  double a2_ = 0.0;
  std::int64_t settling_ = 0;
  Triad state_;
  bool started_ = false;
  bool gyro_valid_ = false;
  bool accel_valid_ = false;
  std::int64_t next_counter_ = 0;
};

}  // namespace imuscope
