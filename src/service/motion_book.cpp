#include "service/motion_book.h"

#include <algorithm>
#include <cmath>

namespace imuscope {

void MotionSums::add(double prediction, double error) noexcept {
  n_ += 1.0;
  const double dp = prediction - mean_p_;
  const double de = error - mean_e_;
  mean_p_ += dp / n_;
  mean_e_ += de / n_;
  sum_pp_ += dp * (prediction - mean_p_);
  sum_pe_ += dp * (error - mean_e_);
  sum_ee_ += de * (error - mean_e_);
  largest_p_ = std::max(largest_p_, std::abs(prediction));
}

AxisMotion MotionSums::report() const {
  AxisMotion report;
  if (n_ == 0.0) return report;
  report.mean = mean_p_;
  report.rms = std::sqrt(sum_pp_ / n_);
  report.largest = largest_p_;
  constexpr double kParameters = 2.0;  // slope and constant
  if (n_ <= kParameters || sum_pp_ <= 0.0) return report;
  report.slope = sum_pe_ / sum_pp_;
  const double residual = std::max(0.0, sum_ee_ - report.slope * sum_pe_);
  report.slope_sd = std::sqrt(residual / (n_ - kParameters) / sum_pp_);
  if (sum_ee_ > 0.0) report.correlation = sum_pe_ / std::sqrt(sum_pp_ * sum_ee_);
  return report;
}

void MotionBook::add(const ErrorRow& row) noexcept {
  ++rows_[static_cast<std::size_t>(row.regime)];
  for (std::size_t i = 0; i < 3; ++i) {
    if (row.gyro_valid) axes_[i].add(row.predicted_omega_s_radps[i], row.e_gyro_radps[i]);
    if (row.accel_valid) axes_[3 + i].add(row.predicted_f_s_mps2[i], row.e_accel_mps2[i]);
  }
}

DynamicsReport MotionBook::report() const {
  DynamicsReport report;
  report.n_static = rows_[static_cast<std::size_t>(Regime::kStatic)];
  report.n_dynamic = rows_[static_cast<std::size_t>(Regime::kDynamic)];
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    report.axes.push_back(axes_[axis].report());
    report.axes.back().axis = axis_name(axis);
    report.axes.back().unit = axis_unit(axis);
  }
  return report;
}

}  // namespace imuscope
