#include "service/pipeline/motion_book.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "publish/message_values.h"

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

axis_dynamics_t MotionSums::message() const {
  axis_dynamics_t message{};
  for (double* unknown : {&message.mean, &message.rms, &message.largest, &message.slope, &message.slope_sd,
                          &message.correlation, &message.r2, &message.f, &message.p_value})
    *unknown = kUnknown;
  if (n_ == 0.0) return message;
  message.mean = mean_p_;
  message.rms = std::sqrt(sum_pp_ / n_);
  message.largest = largest_p_;
  constexpr double kParameters = 2.0;  // slope and constant
  if (n_ <= kParameters || sum_pp_ <= 0.0) return message;
  message.slope = sum_pe_ / sum_pp_;
  const double residual = std::max(0.0, sum_ee_ - message.slope * sum_pe_);
  message.slope_sd = std::sqrt(residual / (n_ - kParameters) / sum_pp_);
  if (sum_ee_ > 0.0) message.correlation = sum_pe_ / std::sqrt(sum_pp_ * sum_ee_);
  return message;
}

MotionBook::MotionBook() : regressions_(kAxisCount, RegressionSums(1, kCovariates)) {}

void MotionBook::add(const ErrorRow& row, Regime regime) {
  const std::int64_t before = rows_[static_cast<std::size_t>(regime)]++;
  if (regime == Regime::kDynamic && before % kRegressionStep == 0) add_to_regression(row);
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

dynamics_t MotionBook::message() const {
  dynamics_t message{};
  message.n_static = rows_[static_cast<std::size_t>(Regime::kStatic)];
  message.n_dynamic = rows_[static_cast<std::size_t>(Regime::kDynamic)];
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    axis_dynamics_t motion = axes_[axis].message();
    motion.axis = axis_name(axis);
    motion.unit = axis_unit(axis);
    if (const auto regression = regressions_[axis].solve()) {
      motion.r2 = regression->r2;
      motion.f = regression->f;
      motion.p_value = regression->p_value;
    }
    message.axes.push_back(std::move(motion));
  }
  message.n_axes = element_count(message.axes);
  if (message.n_dynamic == 0) return message;
  for (std::size_t i = 0; i < kCovariates; ++i) {
    const axis_dynamics_t motion = covariates_[i].message();
    covariate_motion_t covariate{};
    covariate.name = covariate_name(i);
    covariate.unit = covariate_unit(i);
    covariate.mean = motion.mean;
    covariate.rms = motion.rms;
    covariate.largest = motion.largest;
    message.covariates.push_back(std::move(covariate));
  }
  message.n_covariates = element_count(message.covariates);
  return message;
}

}  // namespace imuscope
