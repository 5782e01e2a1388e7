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

MotionBook::MotionBook() : regressions_(kAxisCount, RegressionSums(1, kCovariates)) {}

void MotionBook::add(const ErrorRow& row) {
  const std::int64_t before = rows_[static_cast<std::size_t>(row.regime)]++;
  if (row.regime == Regime::kDynamic && before % kRegressionStep == 0) add_to_regression(row);
  for (std::size_t i = 0; i < 3; ++i) {
    if (row.gyro_valid) axes_[i].add(row.predicted_omega_s_radps[i], row.e_gyro_radps[i]);
    if (row.accel_valid) axes_[3 + i].add(row.predicted_f_s_mps2[i], row.e_accel_mps2[i]);
  }
}

void MotionBook::add_to_regression(const ErrorRow& row) {
  const auto x = covariates(row);
  std::array<double, 1 + kCovariates + 1> columns{1.0};
  std::copy(x.begin(), x.end(), columns.begin() + 1);
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    if (!(axis < 3 ? row.gyro_valid : row.accel_valid)) continue;
    columns.back() = axis < 3 ? row.e_gyro_radps[axis] : row.e_accel_mps2[axis - 3];
    regressions_[axis].add(columns);
  }
  for (std::size_t i = 0; i < kCovariates; ++i) covariates_[i].add(x[i], 0.0);
}

DynamicsReport MotionBook::report() const {
  DynamicsReport report;
  report.n_static = rows_[static_cast<std::size_t>(Regime::kStatic)];
  report.n_dynamic = rows_[static_cast<std::size_t>(Regime::kDynamic)];
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    report.axes.push_back(axes_[axis].report());
    report.axes.back().axis = axis_name(axis);
    report.axes.back().unit = axis_unit(axis);
    if (const auto regression = regressions_[axis].solve()) {
      report.axes.back().r2 = regression->r2;
      report.axes.back().f = regression->f;
      report.axes.back().p_value = regression->p_value;
    }
  }
  if (report.n_dynamic == 0) return report;
  for (std::size_t i = 0; i < kCovariates; ++i) {
    const AxisMotion motion = covariates_[i].report();
    report.covariates.push_back({std::string(covariate_name(i)), std::string(covariate_unit(i)), motion.mean,
                                 motion.rms, motion.largest});
  }
  return report;
}

}  // namespace imuscope
