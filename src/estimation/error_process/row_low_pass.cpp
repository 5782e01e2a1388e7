#include "estimation/error_process/row_low_pass.h"

#include <cmath>
#include <numbers>

#include "base/contracts.h"

namespace imuscope {

namespace {

/// Until a step has settled to a permille: 4 % overshoot decays with the corner's time constant.
constexpr double kSettlingTimes = 7.0;

/// The vectors of a row that pass the filter.
constexpr std::array kVectors = {
    &ErrorRow::e_gyro_radps,       &ErrorRow::e_accel_mps2,       &ErrorRow::predicted_omega_s_radps,
    &ErrorRow::predicted_f_s_mps2, &ErrorRow::omega_dot_s_radps2, &ErrorRow::omega_ddot_s_radps3,
    &ErrorRow::f_dot_s_mps3};

}  // namespace

RowLowPass::RowLowPass(double rate_hz, double corner_hz) {
  IMUSCOPE_EXPECTS(corner_hz > 0.0 && corner_hz < 0.5 * rate_hz);
  static_assert(kSignals == 3 * kVectors.size());
  // P-4: bilinear transform with the corner's frequency kept.
  const double k = std::tan(std::numbers::pi * corner_hz / rate_hz);
  const double norm = 1.0 / (1.0 + std::numbers::sqrt2 * k + k * k);
  b0_ = k * k * norm;
  b1_ = 2.0 * b0_;
  a1_ = 2.0 * (k * k - 1.0) * norm;
  a2_ = (1.0 - std::numbers::sqrt2 * k + k * k) * norm;
  settling_ = static_cast<std::int64_t>(
      std::ceil(kSettlingTimes * std::numbers::sqrt2 * rate_hz / (2.0 * std::numbers::pi * corner_hz)));
}

void RowLowPass::begin(Triad& triad, const std::array<double, kSignals>& x) noexcept {
  triad = {x, x, x, x, 0};
}

void RowLowPass::step(Triad& triad, std::array<double, kSignals>& x) const noexcept {
  for (std::size_t i = 0; i < kSignals; ++i) {
    const double y = b0_ * (x[i] + triad.x2[i]) + b1_ * triad.x1[i] - a1_ * triad.y1[i] - a2_ * triad.y2[i];
    triad.x2[i] = triad.x1[i];
    triad.x1[i] = x[i];
    triad.y2[i] = triad.y1[i];
    triad.y1[i] = y;
    x[i] = y;
  }
  ++triad.run;
}

void RowLowPass::apply(ErrorRow& row) noexcept {
  std::array<double, kSignals> x{};
  for (std::size_t v = 0; v < kVectors.size(); ++v) {
    for (std::size_t i = 0; i < 3; ++i) x[3 * v + i] = (row.*kVectors[v])[i];
  }
  const bool goes_on = started_ && row.counter == next_counter_ && row.gyro_valid == gyro_valid_ &&
                       row.accel_valid == accel_valid_;
  started_ = true;
  next_counter_ = row.counter + 1;
  gyro_valid_ = row.gyro_valid;
  accel_valid_ = row.accel_valid;
  if (!goes_on) begin(state_, x);
  step(state_, x);
  for (std::size_t v = 0; v < kVectors.size(); ++v) {
    for (std::size_t i = 0; i < 3; ++i) (row.*kVectors[v])[i] = x[3 * v + i];
  }
  const bool settled = state_.run > settling_;
  row.gyro_valid = row.gyro_valid && settled;
  row.accel_valid = row.accel_valid && settled;
}

}  // namespace imuscope
