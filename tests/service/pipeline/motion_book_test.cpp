#include "service/pipeline/motion_book.h"

#include <gtest/gtest.h>
#include <cmath>
#include <random>
#include <vector>

namespace imuscope {
namespace {

/// Against the textbook's sums over all data at once.
TEST(MotionSums, AgreeWithTheClosedFormOfTheRegression) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  std::vector<double> p(500);
  std::vector<double> e(500);
  MotionSums sums;
  for (std::size_t i = 0; i < p.size(); ++i) {
    p[i] = 9.8 + 0.3 * normal(random);
    e[i] = 0.02 + 0.01 * p[i] + 0.005 * normal(random);
    sums.add(p[i], e[i]);
  }
  const double n = static_cast<double>(p.size());
  double mean_p = 0.0;
  double mean_e = 0.0;
  for (std::size_t i = 0; i < p.size(); ++i) {
    mean_p += p[i] / n;
    mean_e += e[i] / n;
  }
  double pp = 0.0;
  double pe = 0.0;
  double ee = 0.0;
  double largest = 0.0;
  for (std::size_t i = 0; i < p.size(); ++i) {
    pp += (p[i] - mean_p) * (p[i] - mean_p);
    pe += (p[i] - mean_p) * (e[i] - mean_e);
    ee += (e[i] - mean_e) * (e[i] - mean_e);
    largest = std::max(largest, std::abs(p[i]));
  }
  const double slope = pe / pp;
  double residual = 0.0;
  for (std::size_t i = 0; i < p.size(); ++i) {
    const double r = e[i] - mean_e - slope * (p[i] - mean_p);
    residual += r * r;
  }
  const auto fit = sums.fit();
  EXPECT_NEAR(fit.mean, mean_p, 1e-12);
  EXPECT_NEAR(fit.rms, std::sqrt(pp / n), 1e-12);
  EXPECT_DOUBLE_EQ(fit.largest, largest);
  EXPECT_NEAR(fit.slope, slope, 1e-12);
  EXPECT_NEAR(fit.slope_sd, std::sqrt(residual / (n - 2.0) / pp), 1e-12);
  EXPECT_NEAR(fit.correlation, pe / std::sqrt(pp * ee), 1e-12);
  EXPECT_NEAR(fit.slope, 0.01, 4.0 * fit.slope_sd);
}

TEST(MotionSums, WithoutMotionTheSlopeIsUnknown) {
  MotionSums sums;
  EXPECT_TRUE(std::isnan(sums.fit().mean));
  for (int i = 0; i < 10; ++i) sums.add(1.0, i);
  EXPECT_DOUBLE_EQ(sums.fit().mean, 1.0);
  EXPECT_TRUE(std::isnan(sums.fit().slope));
  EXPECT_TRUE(std::isnan(sums.fit().correlation));
}

TEST(MotionBook, CountsRegimesAndLeavesOutAxesWithoutAValue) {
  MotionBook book;
  ErrorRow row{};
  row.gyro_valid = true;
  row.accel_valid = false;
  row.predicted_omega_s_radps = {1.0, 2.0, -3.0};
  row.regime = Regime::kDynamic;
  book.add(row, row.regime);
  row.regime = Regime::kStatic;
  book.add(row, row.regime);
  book.add(row, row.regime);
  const auto summary = book.summary();
  EXPECT_EQ(summary.n_static, 2);
  EXPECT_EQ(summary.n_dynamic, 1);
  EXPECT_TRUE(std::isnan(summary.axes[0].r2)) << "one sample makes no regression";
  EXPECT_DOUBLE_EQ(summary.axes[2].largest, 3.0);
  EXPECT_TRUE(std::isnan(summary.axes[3].mean)) << "no specific force was ever valid";
}

/// Held against the regression itself: in motion alone, every fifth sample.
TEST(MotionBook, RegressesEveryAxisOnTheFifteenCovariatesInMotion) {
  std::mt19937 random(6);
  std::normal_distribution<double> normal;
  MotionBook book;
  RegressionSums expected(1, kCovariates);
  double largest = 0.0;
  std::int64_t n = 0;
  for (int i = 0; i < 4000; ++i) {
    ErrorRow row{};
    row.gyro_valid = row.accel_valid = true;
    row.regime = i % 2 == 0 ? Regime::kDynamic : Regime::kStatic;
    for (auto* v : {&row.predicted_omega_s_radps, &row.omega_dot_s_radps2, &row.omega_ddot_s_radps3,
                    &row.predicted_f_s_mps2, &row.f_dot_s_mps3}) {
      for (double& component : *v) component = normal(random);
    }
    row.e_gyro_radps[0] = 0.2 * row.f_dot_s_mps3[1] + normal(random);
    book.add(row, row.regime);
    if (row.regime == Regime::kStatic || n++ % 5 != 0) continue;
    std::array<double, 1 + kCovariates + 1> columns{1.0};
    const auto x = covariates(row);
    std::copy(x.begin(), x.end(), columns.begin() + 1);
    columns.back() = row.e_gyro_radps[0];
    expected.add(columns);
    largest = std::max(largest, std::abs(x[13]));
  }
  const auto summary = book.summary();
  const auto regression = expected.solve().value();
  EXPECT_DOUBLE_EQ(summary.axes[0].r2, regression.r2);
  EXPECT_DOUBLE_EQ(summary.axes[0].f, regression.f);
  EXPECT_DOUBLE_EQ(summary.axes[0].p_value, regression.p_value);
  EXPECT_LT(summary.axes[0].p_value, 0.01) << "it depends on the jerk";
  EXPECT_EQ(covariate_name(13), "f_dot_y");
  EXPECT_DOUBLE_EQ(summary.covariates[13].largest, largest);
  EXPECT_NEAR(summary.covariates[13].rms, 1.0, 0.2);
}

}  // namespace
}  // namespace imuscope
