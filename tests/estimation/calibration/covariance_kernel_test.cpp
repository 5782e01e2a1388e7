#include "estimation/calibration/covariance_kernel.h"

#include <gtest/gtest.h>
#include <Eigen/Dense>
#include <random>

namespace imuscope {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// States scaled over many orders of magnitude, as position beside gyro bias.
MatrixXd random_covariance(std::size_t n, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> exponent(-4.0, 1.0);
  const auto size = static_cast<Eigen::Index>(n);
  MatrixXd a(size, size + 5);
  for (Eigen::Index i = 0; i < a.size(); ++i) a.data()[i] = normal(random);
  VectorXd scale(size);
  for (Eigen::Index i = 0; i < size; ++i) scale(i) = std::pow(10.0, exponent(random));
  return scale.asDiagonal() * (a * a.transpose() / static_cast<double>(n)) * scale.asDiagonal();
}

void load(CovarianceKernel& kernel, const MatrixXd& P) {
  for (std::size_t i = 0; i < kernel.dimension(); ++i) {
    for (std::size_t j = i; j < kernel.dimension(); ++j)
      kernel.set(i, j, P(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)));
  }
}

MatrixXd read(const CovarianceKernel& kernel) {
  const auto n = static_cast<Eigen::Index>(kernel.dimension());
  MatrixXd P(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j)
      P(i, j) = kernel(static_cast<std::size_t>(i), static_cast<std::size_t>(j));
  }
  return P;
}

/// Largest difference, each entry relative to the product of its states' sd.
double scaled_difference(const MatrixXd& a, const MatrixXd& oracle) {
  const VectorXd inverse_sd = oracle.diagonal().cwiseSqrt().cwiseInverse();
  return (inverse_sd.asDiagonal() * (a - oracle) * inverse_sd.asDiagonal()).cwiseAbs().maxCoeff();
}

struct Measurement {
  SparseMeasurement sparse;
  MatrixXd dense;
};

Measurement random_measurement(std::size_t n, const MatrixXd& P, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  Measurement m;
  m.dense = MatrixXd::Zero(3, static_cast<Eigen::Index>(n));
  const std::array<std::pair<std::size_t, std::size_t>, 4> columns{{{9, 3}, {15, 3}, {n - 7, 1}, {n - 3, 3}}};
  for (const auto& [column, width] : columns) {
    MeasurementBlock& block = m.sparse.append(column, width);
    for (std::size_t a = 0; a < 3; ++a) {
      for (std::size_t c = 0; c < width; ++c) {
        const auto k = static_cast<Eigen::Index>(column + c);
        block.h[a][c] = normal(random) / std::sqrt(P(k, k));
        m.dense(static_cast<Eigen::Index>(a), k) = block.h[a][c];
      }
    }
  }
  return m;
}

using KernelCase = std::tuple<std::size_t, InstructionSet>;

/// Skips what this processor cannot run.
class CovarianceKernelOfDimension : public testing::TestWithParam<KernelCase> {
 protected:
  void SetUp() override {
    if (covariance_loops(std::get<1>(GetParam())) == nullptr) GTEST_SKIP() << "not on this processor";
  }
};

TEST_P(CovarianceKernelOfDimension, PredictionEqualsTheDenseProductAndStaysExactlySymmetric) {
  const auto [n, set] = GetParam();
  std::mt19937_64 random(11);
  std::normal_distribution<double> normal;
  const MatrixXd P = random_covariance(n, random);
  CovarianceKernel kernel(n, set);
  load(kernel, P);

  KernelTransition transition;
  const auto size = static_cast<Eigen::Index>(n);
  MatrixXd Phi = MatrixXd::Identity(size, size);
  for (Eigen::Index i = 0; i < 9; ++i) {
    for (Eigen::Index j = 0; j < 15; ++j) {
      Phi(i, j) += 0.1 * normal(random) * std::sqrt(P(i, i) / P(j, j));
    }
  }
  for (Eigen::Index i = 9; i < 15; ++i) {
    Phi(i, i) = 0.9 + 0.01 * static_cast<double>(i - 9);
  }
  MatrixXd Q = MatrixXd::Zero(size, size);
  Q.topLeftCorner(15, 15) = 0.01 * P.topLeftCorner(15, 15);
  for (Eigen::Index i = 0; i < 15; ++i) {
    for (Eigen::Index j = 0; j < 15; ++j) {
      const auto at = static_cast<std::size_t>(j) * KernelTransition::kStride + static_cast<std::size_t>(i);
      transition.phi[at] = Phi(i, j);
      transition.noise[at] = Q(i, j);
    }
  }

  kernel.predict_navigation(transition);
  const MatrixXd oracle = Phi * P * Phi.transpose() + Q;
  EXPECT_LT(scaled_difference(read(kernel), oracle), 1e-13);
  EXPECT_TRUE(read(kernel) == read(kernel).transpose());
}

TEST_P(CovarianceKernelOfDimension, DecayOfSomeStatesEqualsTheDenseProductAndStaysExactlySymmetric) {
  const auto [n, set] = GetParam();
  std::mt19937_64 random(12);
  const MatrixXd P = random_covariance(n, random);
  CovarianceKernel kernel(n, set);
  load(kernel, P);
  const auto size = static_cast<Eigen::Index>(n);
  MatrixXd Phi = MatrixXd::Identity(size, size);
  const std::array<double, 3> decay{0.7, 1.0, 0.93};
  std::array<double, 3> variance{};
  for (std::size_t i = 0; i < 3; ++i) {
    const Eigen::Index k = size - 4 + static_cast<Eigen::Index>(i);
    Phi(k, k) = decay[i];
    variance[i] = 0.3 * P(k, k);
  }
  MatrixXd oracle = Phi * P * Phi.transpose();
  for (std::size_t i = 0; i < 3; ++i) {
    const Eigen::Index k = size - 4 + static_cast<Eigen::Index>(i);
    oracle(k, k) += variance[i];
  }
  kernel.predict_states(n - 4, decay, variance);
  EXPECT_LT(scaled_difference(read(kernel), oracle), 1e-14);
  EXPECT_TRUE(read(kernel) == read(kernel).transpose());
}

TEST_P(CovarianceKernelOfDimension, UpdateEqualsTheDenseJosephFormForEveryChoiceOfAxes) {
  const auto [n, set] = GetParam();
  std::mt19937_64 random(13);
  for (unsigned mask = 1; mask < 8; ++mask) {
    const MatrixXd P = random_covariance(n, random);
    CovarianceKernel kernel(n, set);
    load(kernel, P);
    const Measurement m = random_measurement(n, P, random);
    MatrixXd R(3, 3);
    R << 2.0, 0.3, -0.2, 0.3, 1.5, 0.1, -0.2, 0.1, 1.0;
    const std::array<double, 9> r{2.0, 0.3, -0.2, 0.3, 1.5, 0.1, -0.2, 0.1, 1.0};
    const std::array<double, 3> y{0.7, -1.1, 0.4};

    kernel.project(m.sparse, r);
    const MatrixXd S_full = m.dense * P * m.dense.transpose() + R;
    for (std::size_t i = 0; i < 9; ++i) {
      EXPECT_NEAR(kernel.innovation_covariance()[i],
                  S_full(static_cast<Eigen::Index>(i / 3), static_cast<Eigen::Index>(i % 3)),
                  1e-12 * S_full.norm());
    }

    std::array<bool, 3> use{};
    std::vector<Eigen::Index> rows;
    for (unsigned a = 0; a < 3; ++a) {
      use[a] = (mask >> a & 1U) != 0;
      if (use[a]) rows.push_back(a);
    }
    ASSERT_TRUE(kernel.update(y, use));

    const MatrixXd H = m.dense(rows, Eigen::all);
    const MatrixXd R_used = R(rows, rows);
    VectorXd y_used(static_cast<Eigen::Index>(rows.size()));
    for (std::size_t i = 0; i < rows.size(); ++i)
      y_used(static_cast<Eigen::Index>(i)) = y[static_cast<std::size_t>(rows[i])];
    const MatrixXd K = P * H.transpose() * (H * P * H.transpose() + R_used).inverse();
    const MatrixXd I_KH = MatrixXd::Identity(P.rows(), P.cols()) - K * H;
    const MatrixXd oracle = I_KH * P * I_KH.transpose() + K * R_used * K.transpose();
    EXPECT_LT(scaled_difference(read(kernel), oracle), 1e-11);
    EXPECT_TRUE(read(kernel) == read(kernel).transpose());
    const VectorXd dx = K * y_used;
    for (std::size_t i = 0; i < n; ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      EXPECT_NEAR(kernel.correction()[i], dx(k), 1e-12 * std::sqrt(P(k, k)));
    }
  }
}

TEST_P(CovarianceKernelOfDimension, WhatIsConsideredIsToldNothingAndTheRestIsJosephsOfThatGain) {
  const auto [n, set] = GetParam();
  std::mt19937_64 random(17);
  const MatrixXd P = random_covariance(n, random);
  CovarianceKernel kernel(n, set);
  load(kernel, P);
  const Measurement m = random_measurement(n, P, random);
  const std::size_t first = 15;  // a block that is measured
  const std::array<double, 3> y{0.7, -1.1, 0.4};
  kernel.project(m.sparse, {2.0, 0.0, 0.0, 0.0, 1.5, 0.0, 0.0, 0.0, 1.0});
  ASSERT_TRUE(kernel.update(y, {true, true, true}, {first, 3}));

  const MatrixXd R = Eigen::Vector3d(2.0, 1.5, 1.0).asDiagonal();
  MatrixXd K = P * m.dense.transpose() * (m.dense * P * m.dense.transpose() + R).inverse();
  K.middleRows(static_cast<Eigen::Index>(first), 3).setZero();
  const MatrixXd I_KH = MatrixXd::Identity(P.rows(), P.cols()) - K * m.dense;
  const MatrixXd oracle = I_KH * P * I_KH.transpose() + K * R * K.transpose();
  EXPECT_LT(scaled_difference(read(kernel), oracle), 1e-11);
  EXPECT_TRUE(read(kernel) == read(kernel).transpose());
  const VectorXd dx = K * Eigen::Vector3d(y[0], y[1], y[2]);
  for (std::size_t i = 0; i < n; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    EXPECT_NEAR(kernel.correction()[i], dx(k), 1e-12 * std::sqrt(P(k, k)));
  }
  for (std::size_t i = first; i < first + 3; ++i) EXPECT_EQ(kernel.correction()[i], 0.0);
}

INSTANTIATE_TEST_SUITE_P(OneThreeAndSixStudies, CovarianceKernelOfDimension,
                         testing::Combine(testing::Values(27, 34, 72, 129),
                                          testing::Values(InstructionSet::kBaseline, InstructionSet::kAvx2,
                                                          InstructionSet::kAvx512)));

TEST(CovarianceLoops, TheChosenOnesAreTheWidestThatThisProcessorHas) {
  const CovarianceLoops& chosen = widest_covariance_loops();
  EXPECT_EQ(covariance_loops(chosen.instruction_set), &chosen);
  EXPECT_NE(covariance_loops(InstructionSet::kBaseline), nullptr);
  if (covariance_loops(InstructionSet::kAvx512) != nullptr) {
    EXPECT_EQ(chosen.instruction_set, InstructionSet::kAvx512);
  }
}

TEST(CovarianceKernel, UpdateWithoutAPositiveInnovationCovarianceChangesNothing) {
  CovarianceKernel kernel(34);
  for (std::size_t i = 0; i < 34; ++i) kernel.set(i, i, 1.0);
  SparseMeasurement H;
  H.append(15, 3).h = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  kernel.project(H, {-2, 0, 0, 0, 1, 0, 0, 0, 1});
  EXPECT_FALSE(kernel.update({1, 1, 1}, {true, true, true}));
  EXPECT_EQ(kernel(15, 15), 1.0);
  EXPECT_FALSE(kernel.update({1, 1, 1}, {false, false, false}));
  EXPECT_TRUE(kernel.update({1, 1, 1}, {false, true, true}));
  EXPECT_DOUBLE_EQ(kernel(16, 16), 0.5);
}

TEST(CovarianceKernel, PaddingStaysZeroSoThatItNeverLeaksIntoTheStates) {
  CovarianceKernel kernel(34);
  EXPECT_EQ(kernel.padded_dimension(), 40U);
  EXPECT_EQ(CovarianceKernel(129).padded_dimension(), 136U);
  EXPECT_EQ(CovarianceKernel(72).padded_dimension(), 72U);
}

}  // namespace
}  // namespace imuscope
