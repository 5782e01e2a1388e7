#include "models/noise/whitener.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <array>
#include <random>
#include <vector>

namespace imuscope::noise {
namespace {

Model white_and_markov() {
  return {{{ProcessKind::kWhiteNoise, 1.0, {}}, {ProcessKind::kGaussMarkov, 0.8, {0.05, 0.0}}}};
}

/// Covariance matrix of n outputs of a stationary form.
Eigen::MatrixXd covariance_of(const Model& model, int n) {
  Eigen::MatrixXd S(n, n);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      double s = 0.0;
      for (const auto& c : model.components) {
        if (c.kind == ProcessKind::kGaussMarkov) s += c.amplitude * std::exp(-c.shape[0] * std::abs(i - j));
        if (c.kind == ProcessKind::kWhiteNoise && i == j) s += c.amplitude;
      }
      S(i, j) = s;
    }
  }
  return S;
}

// The innovations of a Kalman filter are the rows of the inverse Cholesky factor, so both must agree to the
// last digits, gaps included.
TEST(Whitener, IsTheInverseCholeskyFactorOfTheCovariance) {
  constexpr int kLength = 60;
  std::mt19937 generator(3);
  std::normal_distribution<double> normal;
  std::vector<double> x(kLength);
  for (double& value : x) value = normal(generator);
  std::vector<int> present;
  for (int i = 0; i < kLength; ++i) {
    if (i != 7 && (i < 20 || i > 33)) present.push_back(i);
  }
  const auto n = static_cast<Eigen::Index>(present.size());
  const Eigen::MatrixXd all = covariance_of(white_and_markov(), kLength);
  Eigen::MatrixXd S(n, n);
  Eigen::VectorXd y(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    y(i) = x[static_cast<std::size_t>(present[static_cast<std::size_t>(i)])];
    for (Eigen::Index j = 0; j < n; ++j) {
      S(i, j) = all(present[static_cast<std::size_t>(i)], present[static_cast<std::size_t>(j)]);
    }
  }
  const Eigen::VectorXd expected = S.llt().matrixL().solve(y);

  Whitener whitener(white_and_markov(), 2);
  Eigen::Index at = 0;
  for (int i = 0; i < kLength; ++i) {
    if (at >= n || present[static_cast<std::size_t>(at)] != i) {
      whitener.skip();
      continue;
    }
    std::array<double, 2> row{x[static_cast<std::size_t>(i)], 2.0 * x[static_cast<std::size_t>(i)]};
    ASSERT_TRUE(whitener.push(row));
    EXPECT_NEAR(row[0], expected(at), 1e-11);
    EXPECT_NEAR(row[1], 2.0 * expected(at), 1e-11);
    ++at;
  }
  EXPECT_EQ(at, n);
}

TEST(Whitener, WhiteNoiseIsScaledOnly) {
  Whitener whitener({{{ProcessKind::kWhiteNoise, 4.0, {}}}}, 1);
  std::array<double, 1> row{3.0};
  EXPECT_TRUE(whitener.push(row));
  EXPECT_DOUBLE_EQ(row[0], 1.5);
}

TEST(Whitener, AnUnknownStartCostsOneSampleAndOffsetsDoNotMatter) {
  const Model model{{{ProcessKind::kWhiteNoise, 1.0, {}}, {ProcessKind::kRandomWalk, 0.01, {}}}};
  Whitener a(model, 1);
  Whitener b(model, 1);
  std::mt19937 generator(5);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 200; ++i) {
    const double value = normal(generator);
    std::array<double, 1> row_a{value};
    std::array<double, 1> row_b{value + 100.0};
    const bool counts = a.push(row_a);
    EXPECT_EQ(counts, i > 0);
    EXPECT_EQ(b.push(row_b), counts);
    if (counts) {
      EXPECT_NEAR(row_a[0], row_b[0], 1e-4);
    }
  }
}

}  // namespace
}  // namespace imuscope::noise
