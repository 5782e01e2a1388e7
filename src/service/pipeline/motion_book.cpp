#include "service/pipeline/motion_book.h"

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

MotionFit MotionSums::fit() const {
  MotionFit fit;
  if (n_ == 0.0) return fit;
  fit.mean = mean_p_;
  fit.rms = std::sqrt(sum_pp_ / n_);
  fit.largest = largest_p_;
  constexpr double kParameters = 2.0;  // slope and constant
  if (n_ <= kParameters || sum_pp_ <= 0.0) return fit;
  fit.slope = sum_pe_ / sum_pp_;
  const double residual = std::max(0.0, sum_ee_ - fit.slope * sum_pe_);
  fit.slope_sd = std::sqrt(residual / (n_ - kParameters) / sum_pp_);
  if (sum_ee_ > 0.0) fit.correlation = sum_pe_ / std::sqrt(sum_pp_ * sum_ee_);
  return fit;
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

MotionSummary MotionBook::summary() const {
  MotionSummary summary;
  summary.n_static = rows_[static_cast<std::size_t>(Regime::kStatic)];
  summary.n_dynamic = rows_[static_cast<std::size_t>(Regime::kDynamic)];
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    MotionFit& fit = summary.axes[axis];
    fit = axes_[axis].fit();
    if (const auto regression = regressions_[axis].solve()) {
      fit.r2 = regression->r2;
      fit.f = regression->f;
      fit.p_value = regression->p_value;
    }
  }
  for (std::size_t i = 0; i < kCovariates; ++i) summary.covariates[i] = covariates_[i].fit();
  return summary;
}

}  // namespace imuscope
