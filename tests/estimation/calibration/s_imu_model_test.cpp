#include "estimation/calibration/s_imu_model.h"

#include <gtest/gtest.h>
#include <array>
#include <cmath>
#include <random>
#include <utility>
#include <vector>

#include "estimation/navigation/so3.h"

namespace imuscope {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr std::size_t kFirstStudyState = 15;
constexpr std::uint32_t kEveryBlock = kCompleteSImuBlocks;
constexpr std::size_t kStates = kFirstStudyState + 45;
constexpr ReferenceBiasColumns kReferenceColumns{9, 12};

/// A motion whose derivatives are known exactly: harmonics of rate and force.
struct HarmonicMotion {
  Vector3d omega_amplitude;
  Vector3d f_amplitude;
  Vector3d f_mean;
  double frequency_radps;

  [[nodiscard]] ReferenceKinematics at(double t) const {
    const double s = std::sin(frequency_radps * t + 0.4);
    const double c = std::cos(frequency_radps * t + 0.4);
    const double w = frequency_radps;
    ReferenceKinematics b;
    b.omega_radps = omega_amplitude * s;
    b.omega_dot_radps2 = omega_amplitude * (w * c);
    b.omega_ddot_radps3 = omega_amplitude * (-w * w * s);
    b.f_mps2 = f_mean + f_amplitude * c;
    b.f_dot_mps3 = f_amplitude * (-w * s);
    return b;
  }
};

struct Case {
  SImuState state;
  HarmonicMotion motion;
};

Vector3d random_vector(std::mt19937_64& random, double scale) {
  std::normal_distribution<double> normal;
  return scale * Vector3d{normal(random), normal(random), normal(random)};
}

Case random_case(std::mt19937_64& random, const Vector3d& mounting) {
  Case c;
  c.state.C_b_s = exp_so3(mounting);
  c.state.r_bs_b_m = random_vector(random, 0.4);
  c.state.gyro_bias_s_radps = random_vector(random, 0.01);
  c.state.accel_bias_s_mps2 = random_vector(random, 0.05);
  c.state.t_d_s = 0.004;
  c.state.gyro_scale = random_vector(random, 0.003);
  c.state.accel_scale = random_vector(random, 0.003);
  c.state.accel_turn = exp_so3(random_vector(random, 0.01));
  c.state.accel_t_d_s = 0.0015;
  c.state.gyro_axes = random_vector(random, 0.002);
  c.state.accel_axes = random_vector(random, 0.002);
  c.motion = {random_vector(random, 0.5), random_vector(random, 2.0), Vector3d(0.1, -0.3, -9.8), 4.0};
  return c;
}

/// Prediction with the error state added the way the filter adds it. Written from the definition of the
/// model, by its own arithmetic: rotation, cross products, no Jacobian.
VectorXd predicted(const Case& c, const std::array<double, kStates>& error) {
  SImuState x = c.state;
  inject(x, SImuLayout::make(kEveryBlock, kFirstStudyState), error);
  const Vector3d gyro_bias(error[9], error[10], error[11]);
  const ReferenceKinematics b = c.motion.at(x.t_d_s);
  const Vector3d omega_s = x.C_b_s * (b.omega_radps - gyro_bias);
  const ReferenceKinematics a = c.motion.at(x.t_d_s + x.accel_t_d_s);
  // The arms' share follows the reference's gyros, its forces the reference's accelerometers.
  const ReferenceKinematics arms = c.motion.at(x.t_d_s + x.accel_t_d_s + x.reference_accel_t_d_s);
  const Vector3d omega = arms.omega_radps - gyro_bias;
  const Vector3d f = a.f_mps2 - Vector3d(error[12], error[13], error[14]);
  const Vector3d f_at_s = f + omega.cross(omega.cross(x.r_bs_b_m)) + arms.omega_dot_radps2.cross(x.r_bs_b_m);
  const Vector3d f_s = x.C_b_s * (x.accel_turn * f_at_s);
  // Each accelerometer at a place of its own, which the vehicle's rotation accelerates by its own amount.
  const double half = std::sqrt(0.5);
  const double sixth = std::sqrt(1.0 / 6.0);
  const Eigen::Matrix<double, 3, 2> patterns{{half, sixth}, {-half, sixth}, {0.0, -2.0 * sixth}};
  Vector3d at_place = f_s;
  for (Eigen::Index i = 0; i < 3; ++i) {
    const Vector3d place_s =
        patterns(i, 0) * x.places_s_m.head<3>() + patterns(i, 1) * x.places_s_m.tail<3>();
    const Vector3d d = x.C_b_s.transpose() * place_s;
    const Vector3d felt = omega.cross(omega.cross(d)) + arms.omega_dot_radps2.cross(d);
    at_place(i) += (x.C_b_s * (x.accel_turn * felt))(i);
  }
  const auto leaning = [](const Vector3d& axes, const Vector3d& v) {
    return Vector3d(axes.z() * v.y() + axes.y() * v.z(), axes.z() * v.x() + axes.x() * v.z(),
                    axes.y() * v.x() + axes.x() * v.y());
  };
  const Vector3d f_gyro = b.f_mps2 - Vector3d(error[12], error[13], error[14]);
  const Vector3d omega_b = b.omega_radps - gyro_bias;
  const Vector3d felt_gyro =
      f_gyro + omega_b.cross(omega_b.cross(x.r_bs_b_m)) + b.omega_dot_radps2.cross(x.r_bs_b_m);
  VectorXd z(6);
  z.head<3>() = omega_s + x.gyro_scale.cwiseProduct(omega_s) + leaning(x.gyro_axes, omega_s) +
                x.g_sensitivity * (x.C_b_s * felt_gyro) + x.gyro_bias_s_radps;
  z.tail<3>() =
      at_place + x.accel_scale.cwiseProduct(at_place) + leaning(x.accel_axes, at_place) + x.accel_bias_s_mps2;
  return z;
}

MatrixXd dense(const SparseMeasurement& H) {
  MatrixXd out = MatrixXd::Zero(3, static_cast<Eigen::Index>(kStates));
  for (std::size_t k = 0; k < H.count; ++k) {
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < H.blocks[k].width; ++j)
        out(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(H.blocks[k].column + j)) =
            H.blocks[k].h[i][j];
    }
  }
  return out;
}

/// At places and g-sensitivities of zero, where nothing of their columns' share in others is left out.
TEST(SImuMeasurement, JacobiansMatchCentralDifferencesAtIdentityRightAnglesAndRandomMountings) {
  std::mt19937_64 random(21);
  const SImuLayout layout = SImuLayout::make(kEveryBlock, kFirstStudyState);
  std::vector<Vector3d> mountings{Vector3d::Zero(), Vector3d(0, 0, 1.5707963267948966),
                                  Vector3d(3.14159265358979, 0, 0)};
  for (int i = 0; i < 20; ++i) mountings.push_back(random_vector(random, 1.5));

  // Prior sd of every state: blocks are compared as the filter weighs them.
  std::array<double, kStates> scale{};
  scale.fill(1.0);
  for (std::size_t i = 9; i < 12; ++i) scale[i] = 1e-3;
  for (std::size_t i = 12; i < 15; ++i) scale[i] = 1e-2;
  for (std::size_t i = 0; i < 3; ++i) {
    scale[layout.psi + i] = 0.035;
    scale[layout.r + i] = 0.05;
    scale[layout.gyro_bias + i] = 0.005;
    scale[layout.accel_bias + i] = 0.05;
    scale[layout.gyro_scale + i] = 0.003;
    scale[layout.accel_scale + i] = 0.003;
    scale[layout.accel_boresight + i] = 0.002;
    scale[layout.gyro_axes + i] = scale[layout.accel_axes + i] = 0.001;
  }
  for (std::size_t i = 0; i < 6; ++i) scale[layout.places + i] = 0.02;
  for (std::size_t i = 0; i < 9; ++i) scale[layout.g_sensitivity + i] = 1e-4;
  scale[layout.t_d] = 0.01;
  scale[layout.accel_t_d] = 0.002;
  scale[layout.reference_accel_t_d] = 0.001;
  const std::array<std::pair<std::size_t, std::size_t>, 16> blocks{{{9, 3},
                                                                    {12, 3},
                                                                    {layout.psi, 3},
                                                                    {layout.r, 3},
                                                                    {layout.gyro_bias, 3},
                                                                    {layout.accel_bias, 3},
                                                                    {layout.t_d, 1},
                                                                    {layout.gyro_scale, 3},
                                                                    {layout.accel_scale, 3},
                                                                    {layout.accel_boresight, 3},
                                                                    {layout.accel_t_d, 1},
                                                                    {layout.gyro_axes, 3},
                                                                    {layout.accel_axes, 3},
                                                                    {layout.places, 6},
                                                                    {layout.g_sensitivity, 9},
                                                                    {layout.reference_accel_t_d, 1}}};

  for (const Vector3d& mounting : mountings) {
    const Case c = random_case(random, mounting);
    const ReferenceKinematics b = c.motion.at(c.state.t_d_s);
    const ReferenceKinematics a = c.motion.at(c.state.t_d_s + c.state.accel_t_d_s);
    MatrixXd H(6, static_cast<Eigen::Index>(kStates));
    H << dense(gyro_measurement(c.state, layout, kReferenceColumns, b, b, {}).H),
        dense(accel_measurement(c.state, layout, kReferenceColumns, a, a, {}).H);
    for (const auto& [first, width] : blocks) {
      MatrixXd analytic(6, static_cast<Eigen::Index>(width));
      MatrixXd numeric(6, static_cast<Eigen::Index>(width));
      for (std::size_t j = 0; j < width; ++j) {
        const double step = 1e-2 * scale[first + j];
        // Fourth order in the step, so that truncation stays below the tolerance at steps far above rounding.
        std::array<VectorXd, 4> z;
        const std::array<double, 4> multiples{-2.0, -1.0, 1.0, 2.0};
        for (std::size_t k = 0; k < 4; ++k) {
          std::array<double, kStates> error{};
          error[first + j] = multiples[k] * step;
          z[k] = predicted(c, error);
        }
        const auto column = static_cast<Eigen::Index>(j);
        numeric.col(column) = (8.0 * (z[2] - z[1]) - (z[3] - z[0])) / (12.0 * step) * scale[first + j];
        analytic.col(column) = H.col(static_cast<Eigen::Index>(first + j)) * scale[first + j];
      }
      // Gyro and accelerometer rows carry different units, so each half is held to its own largest entry.
      for (const Eigen::Index row : {0, 3}) {
        const auto exact = analytic.middleRows(row, 3);
        const auto n = numeric.middleRows(row, 3);
        const double tolerance = 1e-7 * std::max(exact.cwiseAbs().maxCoeff(), 1e-6);
        EXPECT_LT((exact - n).cwiseAbs().maxCoeff(), tolerance)
            << "block at " << first << ", rows from " << row;
      }
    }
  }
}

TEST(ReferenceMean, PredictsTheMeanOfItsSamplesPredictions) {
  std::mt19937_64 random(27);
  const Case c = random_case(random, random_vector(random, 1.5));
  const Vector3d gyro_bias(0.01, -0.02, 0.005);
  const Vector3d accel_bias(0.05, 0.02, -0.03);
  ReferenceMean mean;
  Vector3d rate = Vector3d::Zero();
  Vector3d force = Vector3d::Zero();
  double weights = 0.0;
  for (int k = 0; k < 20; ++k) {
    const double weight = 1.0 + 0.3 * k;
    const ReferenceKinematics b = c.motion.at(0.01 * k);
    mean.add(weight, b);
    ReferenceMean single(b);
    single.compensate(gyro_bias, accel_bias);
    rate += weight * predicted_rate(c.state, single);
    force += weight * predicted_force(c.state, single);
    weights += weight;
  }
  mean.scale(1.0 / weights);
  mean.compensate(gyro_bias, accel_bias);
  EXPECT_LT((predicted_rate(c.state, mean) - rate / weights).norm(), 1e-14);
  EXPECT_LT((predicted_force(c.state, mean) - force / weights).norm(), 1e-13);
}

TEST(SImuMeasurement, AtRestTheRotationAboutTheForceIsInvisibleWhateverTheEstimate) {
  std::mt19937_64 random(22);
  const SImuLayout layout = SImuLayout::make(kFullSImuBlocks, kFirstStudyState);
  ReferenceKinematics rest;
  rest.f_mps2 = Vector3d(0.3, -0.2, -9.8);
  for (int i = 0; i < 10; ++i) {
    Case c = random_case(random, random_vector(random, 1.5));
    c.state.accel_turn.setIdentity();
    const MatrixXd H = dense(accel_measurement(c.state, layout, kReferenceColumns, rest, rest, {}).H);
    const Vector3d about_force = rest.f_mps2.normalized();
    EXPECT_LT((H.middleCols(static_cast<Eigen::Index>(layout.psi), 3) * about_force).norm(), 1e-14);
  }
}

TEST(SImuMeasurement, ReferenceNoiseEqualsThatOfSampledReferences) {
  std::mt19937_64 random(23);
  std::normal_distribution<double> normal;
  const SImuLayout layout = SImuLayout::make(kFullSImuBlocks, kFirstStudyState);
  const Case c = random_case(random, random_vector(random, 1.0));
  const ReferenceKinematics b = c.motion.at(0.0);
  const ReferenceNoise noise{1e-3, 0.2, 5e-2};
  const SImuMeasurement gyro = gyro_measurement(c.state, layout, kReferenceColumns, b, b, noise);
  const SImuMeasurement accel = accel_measurement(c.state, layout, kReferenceColumns, b, b, noise);
  constexpr int kDraws = 40000;
  Matrix3d gyro_sum = Matrix3d::Zero();
  Matrix3d accel_sum = Matrix3d::Zero();
  for (int i = 0; i < kDraws; ++i) {
    ReferenceKinematics noisy = b;
    noisy.omega_radps += random_vector(random, noise.omega_radps);
    noisy.omega_dot_radps2 += random_vector(random, noise.omega_dot_radps2);
    noisy.f_mps2 += random_vector(random, noise.f_mps2);
    const Vector3d dg = predicted_rate(c.state, noisy) - gyro.predicted;
    const Vector3d da = predicted_force(c.state, noisy) - accel.predicted;
    gyro_sum += dg * dg.transpose();
    accel_sum += da * da.transpose();
  }
  // Relative sd of a sample variance is sqrt(2/n) = 0.7 %; 4 of them.
  const double tolerance = 4.0 * std::sqrt(2.0 / kDraws);
  EXPECT_LT((gyro_sum / kDraws - gyro.reference_covariance).norm(),
            tolerance * gyro.reference_covariance.norm());
  EXPECT_LT((accel_sum / kDraws - accel.reference_covariance).norm(),
            tolerance * accel.reference_covariance.norm());
}

/// Mean square of what the prediction does beyond its linear part, over drawn errors.
struct SecondOrder {
  Matrix3d rate = Matrix3d::Zero();
  Matrix3d force = Matrix3d::Zero();
};
SecondOrder drawn_second_order(const Case& c, const LinearisationSpread& spread, std::mt19937_64& random) {
  const SImuLayout layout = SImuLayout::make(kEveryBlock, kFirstStudyState);
  const ReferenceKinematics b = c.motion.at(c.state.t_d_s);
  const ReferenceKinematics a = c.motion.at(c.state.t_d_s + c.state.accel_t_d_s);
  const MatrixXd H_gyro = dense(gyro_measurement(c.state, layout, kReferenceColumns, b, b, {}).H);
  const MatrixXd H_accel = dense(accel_measurement(c.state, layout, kReferenceColumns, a, a, {}).H);
  const VectorXd expected = predicted(c, {});
  SecondOrder sum;
  constexpr int kDraws = 20'000;
  std::normal_distribution<double> normal;
  for (int i = 0; i < kDraws; ++i) {
    std::array<double, kStates> error{};
    const Vector3d psi = spread.psi_rad2.llt().matrixL() * random_vector(random, 1.0);
    const Vector3d r = spread.r_m2.llt().matrixL() * random_vector(random, 1.0);
    for (std::size_t k = 0; k < 3; ++k) {
      error[layout.psi + k] = psi(static_cast<Eigen::Index>(k));
      error[layout.r + k] = r(static_cast<Eigen::Index>(k));
    }
    error[layout.t_d] = std::sqrt(spread.t_d_s2) * normal(random);
    const Eigen::Map<const VectorXd> e(error.data(), static_cast<Eigen::Index>(error.size()));
    const VectorXd beyond = predicted(c, error) - expected;
    const Vector3d rate = beyond.head<3>() - H_gyro * e;
    const Vector3d force = beyond.tail<3>() - H_accel * e;
    sum.rate += rate * rate.transpose() / kDraws;
    sum.force += force * force.transpose() / kDraws;
  }
  return sum;
}

TEST(SImuMeasurement, WhatTheDerivativesLeaveOutIsCoveredByItsSecondOrder) {
  std::mt19937_64 random(29);
  for (int i = 0; i < 30; ++i) {
    Case c = random_case(random, random_vector(random, 1.5));
    // The square of the time offset is left out: a motion that changes in seconds, as a vehicle's does.
    c.motion.frequency_radps = 1.0;
    LinearisationSpread spread;
    spread.psi_rad2 = Vector3d(4e-5, 4e-5, 1.6e-3).asDiagonal();
    spread.r_m2 = Vector3d(0.25, 0.25, 0.01).asDiagonal();
    spread.t_d_s2 = 1e-4;
    const SecondOrder drawn = drawn_second_order(c, spread, random);
    const Matrix3d rate = second_order_rate(c.state, c.motion.at(c.state.t_d_s), spread);
    const Matrix3d force =
        second_order_force(c.state, c.motion.at(c.state.t_d_s + c.state.accel_t_d_s), spread);
    // Correlations of the products are not in it: right to a factor.
    for (const auto& [claimed, seen] : {std::pair{rate, drawn.rate}, std::pair{force, drawn.force}}) {
      EXPECT_GT(claimed.trace(), 0.6 * seen.trace()) << i;
      EXPECT_LT(claimed.trace(), 2.0 * seen.trace()) << i;
    }
  }
}

TEST(SImuMeasurement, WhatIsKnownHasNoSecondOrder) {
  std::mt19937_64 random(30);
  const Case c = random_case(random, random_vector(random, 1.5));
  EXPECT_EQ(second_order_rate(c.state, c.motion.at(0.0), {}), Matrix3d::Zero());
  EXPECT_EQ(second_order_force(c.state, c.motion.at(0.0), {}), Matrix3d::Zero());
}

TEST(SImuLayout, LeavesOutWhatIsSwitchedOff) {
  const SImuLayout paper = SImuLayout::make(kPaperSImuBlocks, 15);
  EXPECT_EQ(paper.size, 6U);
  EXPECT_EQ(paper.psi, 15U);
  EXPECT_EQ(paper.r, 18U);
  EXPECT_EQ(paper.gyro_bias, SImuLayout::kAbsent);
  EXPECT_EQ(SImuLayout::make(kFullSImuBlocks, 15).size, 19U);
  EXPECT_EQ(SImuLayout::make(kBiasSImuBlocks, 15).size, 6U);
  EXPECT_EQ(SImuLayout::make(kCompleteSImuBlocks, 15).size, 45U);
}

TEST(InflatedVariance, ReproducesTheLowFrequencyEquivalentsOfTableII) {
  // Paper, Table II, in (deg/s)^2 at 100 Hz: dynamic 0.654 -> 0.854, static 0.506 -> 0.613.
  EXPECT_NEAR(inflated_variance(std::sqrt(0.65382), std::sqrt(0.00168), 1.0 / 1.68012, 0.01), 0.854, 5e-4);
  EXPECT_NEAR(inflated_variance(std::sqrt(0.50552), std::sqrt(0.05528), 1.0 / 113.51523, 0.01), 0.613, 5e-4);
  EXPECT_EQ(inflated_variance(2.0, 0.0, 0.0, 0.01), 4.0);
  EXPECT_EQ(inflated_variance(2.0, 3.0, 0.0, 0.01), 4.0) << "no time constant: no such process";
}

}  // namespace
}  // namespace imuscope
