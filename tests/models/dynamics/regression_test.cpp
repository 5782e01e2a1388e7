#include "models/dynamics/regression.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <Eigen/QR>
#include <cmath>
#include <random>
#include <vector>

#include "models/noise/fit.h"
#include "models/noise/wavelet_variance.h"
#include "models/noise/whitener.h"

namespace imuscope {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Columns [1, z, x1, x2, x3] and y = 2 + z - x1 + 0.5 x3 + noise, with unlike scales and offsets.
MatrixXd random_rows(Index n, unsigned seed) {
  std::mt19937 generator(seed);
  std::normal_distribution<double> normal;
  MatrixXd rows(n, 6);
  for (Index i = 0; i < n; ++i) {
    rows(i, 0) = 1.0;
    rows(i, 1) = 1e3 * normal(generator);
    rows(i, 2) = 1e-4 * normal(generator) + 3e-4;
    rows(i, 3) = normal(generator) - 9.8;
    rows(i, 4) = 10.0 * normal(generator) + 0.01 * rows(i, 1);
    rows(i, 5) = 2.0 + rows(i, 1) * 1e-3 - 1e4 * rows(i, 2) + 0.05 * rows(i, 4) + 0.3 * normal(generator);
  }
  return rows;
}

RegressionSums sums_of(const MatrixXd& rows, std::size_t nuisance) {
  RegressionSums sums(nuisance, static_cast<std::size_t>(rows.cols()) - 1 - nuisance);
  for (Index i = 0; i < rows.rows(); ++i) {
    const VectorXd row = rows.row(i);
    sums.add({row.data(), static_cast<std::size_t>(row.size())});
  }
  return sums;
}

double rss_by_qr(const MatrixXd& X, const VectorXd& y) {
  return (y - X * X.colPivHouseholderQr().solve(y)).squaredNorm();
}

TEST(Regression, AgreesWithLeastSquaresByQr) {
  const MatrixXd rows = random_rows(1000, 1);
  const auto result = sums_of(rows, 2).solve();
  ASSERT_TRUE(result);
  const MatrixXd X = rows.leftCols(5);
  const VectorXd y = rows.col(5);
  const VectorXd beta = X.colPivHouseholderQr().solve(y);
  const double rss = rss_by_qr(X, y);
  const double null_rss = rss_by_qr(rows.leftCols(2), y);
  const MatrixXd inverse = (X.transpose() * X).inverse();
  EXPECT_EQ(result->n, 1000U);
  EXPECT_EQ(result->dof_model, 3);
  EXPECT_EQ(result->dof_rest, 995.0);
  EXPECT_NEAR(result->r2, 1.0 - rss / null_rss, 1e-9);
  EXPECT_NEAR(result->f, (null_rss - rss) / 3.0 / (rss / 995.0), 1e-6 * result->f);
  ASSERT_EQ(result->coefficients.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    const auto at = static_cast<Index>(i) + 2;
    const auto& c = result->coefficients[i];
    EXPECT_EQ(c.covariate, i);
    EXPECT_NEAR(c.value, beta(at), 1e-8 * std::abs(beta(at)) + 1e-12);
    EXPECT_NEAR(c.sd, std::sqrt(rss / 995.0 * inverse(at, at)), 1e-6 * c.sd);
    EXPECT_LT(c.ci_low, c.value);
    EXPECT_GT(c.ci_high, c.value);
  }
  EXPECT_LT(result->coefficients[0].p_value, 1e-10);  // planted
  EXPECT_GT(result->coefficients[1].p_value, 1e-3);   // not planted
}

TEST(Regression, WithOneInterceptTheFourNumbersOfTheLiteratureAreTied) {
  const auto result = sums_of(random_rows(400, 2), 1).solve();
  ASSERT_TRUE(result);
  // F = (R^2 / p) / ((1 - R^2) / (n - p - 1))
  EXPECT_NEAR(result->f, result->r2 / 4.0 / ((1.0 - result->r2) / 395.0), 1e-9 * result->f);
}

TEST(Regression, NamesConstantAndCollinearColumns) {
  MatrixXd rows = random_rows(500, 3);
  rows.col(3).setConstant(4.0);
  rows.col(4) = 2.0 * rows.col(2) + rows.col(1);
  const auto result = sums_of(rows, 2).solve();
  ASSERT_TRUE(result);
  EXPECT_EQ(result->dof_model, 1);
  ASSERT_EQ(result->left_out.size(), 2U);
  EXPECT_EQ(result->left_out[0], std::pair(std::size_t{1}, LeftOut::kConstant));
  EXPECT_EQ(result->left_out[1], std::pair(std::size_t{2}, LeftOut::kCollinear));
}

TEST(Regression, SaysNothingWithoutRowsOrMotion) {
  EXPECT_FALSE(sums_of(random_rows(5, 4), 2).solve());
  MatrixXd rows = random_rows(100, 5);
  rows.middleCols(2, 3).setConstant(1.0);
  EXPECT_FALSE(sums_of(rows, 2).solve());
}

TEST(Regression, PValuesOfTheFTestAreUniformUnderTheHypothesis) {
  constexpr int kRuns = 2000;
  std::mt19937 generator(7);
  std::normal_distribution<double> normal;
  int rejected = 0;
  for (int run = 0; run < kRuns; ++run) {
    RegressionSums sums(1, 3);
    for (int i = 0; i < 60; ++i) {
      const std::array<double, 5> row{1.0, normal(generator), normal(generator), normal(generator),
                                      normal(generator)};
      sums.add(row);
    }
    rejected += sums.solve()->p_value < 0.05 ? 1 : 0;
  }
  // 5 % of 2000 is 100 with sd 9.7: four sd either way.
  EXPECT_NEAR(rejected, 100, 39);
}

// Slow noise and slow covariates: ordinary least squares finds what is not there, whitened rows do not.
TEST(Regression, WhitenedRowsHoldTheirLevelUnderAutocorrelation) {
  constexpr int kRuns = 400;
  constexpr int kLength = 400;
  const noise::Model model{
      {{noise::ProcessKind::kWhiteNoise, 0.5, {}}, {noise::ProcessKind::kGaussMarkov, 1.0, {0.05, 0.0}}}};
  std::mt19937 generator(9);
  std::normal_distribution<double> normal;
  const double phi = std::exp(-0.05);
  const double drive = std::sqrt(1.0 - phi * phi);
  int ordinary = 0;
  int generalised = 0;
  for (int run = 0; run < kRuns; ++run) {
    RegressionSums plain(1, 1);
    RegressionSums whitened(1, 1);
    noise::Whitener whitener(model, 3);
    double x = normal(generator);
    double markov = normal(generator);
    for (int i = 0; i < kLength; ++i) {
      std::array<double, 3> row{1.0, x, markov + std::sqrt(0.5) * normal(generator)};
      plain.add(row);
      ASSERT_TRUE(whitener.push(row));
      whitened.add(row);
      x = phi * x + drive * normal(generator);
      markov = phi * markov + drive * normal(generator);
    }
    ordinary += plain.solve()->p_value < 0.05 ? 1 : 0;
    generalised += whitened.solve()->p_value < 0.05 ? 1 : 0;
  }
  EXPECT_GT(ordinary, kRuns / 4);
  EXPECT_NEAR(generalised, 20, 18);  // 5 % of 400, sd 4.4
}

TEST(Regression, OfNoRowsHasCoefficientsOfZero) {
  const RegressionSums sums(2, 3);
  EXPECT_EQ(sums.count(), 0U);
  EXPECT_TRUE(sums.all_coefficients().isZero(0.0));
  EXPECT_TRUE(sums.all_covariances().isZero(0.0));
  EXPECT_FALSE(sums.solve());
}

TEST(Regression, ColumnsOfZerosAreLeftOutAndTheOthersAreAsWithoutThem) {
  MatrixXd rows = random_rows(300, 6);
  rows.col(1).setZero();  // a nuisance, such as a lever arm's column at standstill
  rows.col(3).setZero();
  const auto result = sums_of(rows, 2).solve();
  ASSERT_TRUE(result);
  ASSERT_EQ(result->left_out.size(), 1U) << "of nuisance columns nothing is said";
  EXPECT_EQ(result->left_out[0], std::pair(std::size_t{1}, LeftOut::kConstant));
  MatrixXd X(300, 3);
  X << rows.col(0), rows.col(2), rows.col(4);
  const VectorXd beta = X.colPivHouseholderQr().solve(rows.col(5));
  ASSERT_EQ(result->coefficients.size(), 2U);
  EXPECT_NEAR(result->coefficients[0].value, beta(1), 1e-8 * std::abs(beta(1)));
  EXPECT_NEAR(result->coefficients[1].value, beta(2), 1e-8 * std::abs(beta(2)) + 1e-12);
  EXPECT_EQ(result->dof_rest, 297.0);
}

/// Columns [1, x1, x2, x3], slow but for the intercept, and y = 0.1 x1 + white noise of variance 1.
MatrixXd slow_rows(Index n, unsigned seed) {
  std::mt19937 generator(seed);
  std::normal_distribution<double> normal;
  MatrixXd rows(n, 5);
  Eigen::Vector3d x = Eigen::Vector3d::Zero();
  for (Index i = 0; i < n; ++i) {
    for (double& value : x) value = 0.998 * value + 0.06 * normal(generator);
    rows.row(i) << 1.0, x.transpose(), 0.1 * x(0) + normal(generator);
  }
  return rows;
}

/// Scales of the columns of rows, the last being the error.
std::vector<ColumnLevel> scales_of(const MatrixXd& rows) {
  ColumnWavelets wavelets(static_cast<std::size_t>(rows.cols()) - 1);
  for (Index i = 0; i < rows.rows(); ++i) {
    const VectorXd row = rows.row(i).head(rows.cols() - 1);
    wavelets.add({row.data(), static_cast<std::size_t>(row.size())});
  }
  return wavelets.levels();
}

// The less is known of the noise, the less is certain: up to a model of which nothing is known, where the
// denominator has next to no degree of freedom.
TEST(Regression, WhereNothingIsKnownOfTheNoiseNothingIsRejected) {
  const MatrixXd rows = slow_rows(8192, 12);
  const auto sums = sums_of(rows, 1);
  std::mt19937 generator(13);
  std::normal_distribution<double> normal;
  std::vector<double> noise(static_cast<std::size_t>(rows.rows()));
  for (double& value : noise) value = normal(generator);
  const auto wv = noise::haar_wavelet_variance(noise).value();
  const auto fitted = noise::fit(wv, noise::parse_model("WN").value(), 100.0).value();
  const auto levels = scales_of(rows);
  const auto with_error = [&](double share) {
    auto fit = fitted;
    fit.model_error = share;
    const NoiseUncertainty uncertainty(levels, fit, wv);
    return *sums.solve(0.95, &uncertainty);
  };
  const auto certain = *sums.solve();
  const auto good = with_error(0.01);
  const auto poor = with_error(0.5);
  const auto nothing = with_error(1e3);
  EXPECT_LE(good.dof_rest, certain.dof_rest);
  EXPECT_LT(poor.dof_rest, good.dof_rest);
  EXPECT_LT(nothing.dof_rest, 2.0) << "an F of so few has no mean";
  EXPECT_GT(nothing.dof_rest, 0.0);
  EXPECT_LT(certain.p_value, 1e-10);
  EXPECT_GT(nothing.p_value, 1e-3);
  for (std::size_t i = 0; i < certain.coefficients.size(); ++i) {
    const auto& c = certain.coefficients[i];
    const auto& n = nothing.coefficients[i];
    EXPECT_EQ(n.value, c.value);
    EXPECT_EQ(n.sd, c.sd);
    EXPECT_LT(n.ci_low, c.ci_low);
    EXPECT_GT(n.ci_high, c.ci_high);
    EXPECT_TRUE(std::isfinite(n.ci_low) && std::isfinite(n.ci_high));
  }
}

}  // namespace
}  // namespace imuscope
