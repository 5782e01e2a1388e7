#include "estimation/navigation/error_model.h"

#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <unsupported/Eigen/MatrixFunctions>

#include "estimation/navigation/gnss_measurement.h"
#include "estimation/navigation/gravity.h"
#include "estimation/navigation/so3.h"
#include "estimation/navigation/strapdown.h"
#include "tests/estimation/navigation/random_states.h"
#include "tests/support/full_matrix.h"

namespace imuscope {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr std::array<const char*, 5> kBlockNames{"dr", "dv", "phi", "db_g", "db_a"};
/// Steps of the central differences: small enough for the third order to vanish, large enough for rounding.
constexpr std::array<double, 5> kStateSteps{100.0, 0.1, 1e-4, 1e-3, 1e-3};
/// The bound: of the largest entry of a block.
constexpr double kRelative = 1e-7;

NavigationErrorVector step_along(int column) {
  NavigationErrorVector x = NavigationErrorVector::Zero();
  x(column) = kStateSteps[static_cast<std::size_t>(column / 3)];
  return x;
}

void expect_blocks_equal(const Eigen::MatrixXd& analytic, const Eigen::MatrixXd& numeric) {
  for (int r = 0; r < analytic.rows(); r += 3) {
    for (int c = 0; c < analytic.cols(); c += 3) {
      const double largest = analytic.block<3, 3>(r, c).cwiseAbs().maxCoeff();
      const double difference =
          (analytic.block<3, 3>(r, c) - numeric.block<3, 3>(r, c)).cwiseAbs().maxCoeff();
      // A block that is zero must come out below what rounding of its row's own terms leaves.
      const double row_scale = analytic.middleRows<3>(r).cwiseAbs().maxCoeff();
      const double bound = largest > 0.0 ? kRelative * largest : 1e-12 * row_scale;
      EXPECT_LE(difference, bound) << "row block " << r / 3 << ", column block "
                                   << kBlockNames[static_cast<std::size_t>(c / 3)] << "\nanalytic\n"
                                   << analytic.block<3, 3>(r, c) << "\nnumeric\n"
                                   << numeric.block<3, 3>(r, c);
    }
  }
}

/// The non-linear equations of motion, written down once more.
struct Rates {
  double latitude, longitude, height;
  Vector3d v;
  Vector3d u;  // C w_ib - w_in: rate of b relative to n, resolved in n
};

Rates motion(const NavigationState& s, const InertialRates& measured) {
  const Curvature k = curvature_at(s.position.latitude_rad);
  const double M = k.meridian_m + s.position.height_m;
  const double N = k.transverse_m + s.position.height_m;
  const double L = s.position.latitude_rad;
  const Vector3d w_ie(kEarthRate_radps * std::cos(L), 0.0, -kEarthRate_radps * std::sin(L));
  const Vector3d w_en(s.v_n_mps.y() / N, -s.v_n_mps.x() / M, -s.v_n_mps.y() * std::tan(L) / N);
  const Vector3d g(0.0, 0.0, normal_gravity(L, s.position.height_m).g_mps2);
  Rates d;
  d.latitude = s.v_n_mps.x() / M;
  d.longitude = s.v_n_mps.y() / (N * std::cos(L));
  d.height = -s.v_n_mps.z();
  d.v = s.C_b_n * (measured.f_b_mps2 - s.accel_bias_b_mps2) + g - (2.0 * w_ie + w_en).cross(s.v_n_mps);
  d.u = s.C_b_n * (measured.omega_ib_b_radps - s.gyro_bias_b_radps) - w_ie - w_en;
  return d;
}

/// d/dt of the error states at error x, odd part in x exact.
Eigen::Matrix<double, 9, 1> error_rate(const NavigationState& estimate, const InertialRates& measured,
                                       const NavigationErrorVector& x) {
  NavigationState truth = estimate;
  inject(truth, x);
  const Rates e = motion(estimate, measured);
  const Rates t = motion(truth, measured);
  const Curvature k = curvature_at(estimate.position.latitude_rad);
  const double M = k.meridian_m + estimate.position.height_m;
  const double N = k.transverse_m + estimate.position.height_m;
  const double s = std::sin(estimate.position.latitude_rad);
  const double c = std::cos(estimate.position.latitude_rad);
  const double M_rate = k.meridian_slope_m * e.latitude + e.height;
  const double N_rate = k.transverse_slope_m * e.latitude + e.height;
  Eigen::Matrix<double, 9, 1> out;
  // dr = (M dL, N cos L dlambda, -dh) with the estimate's M, N, L, which move too.
  out(0) =
      M_rate * (truth.position.latitude_rad - estimate.position.latitude_rad) + M * (t.latitude - e.latitude);
  out(1) =
      (N_rate * c - N * s * e.latitude) * (truth.position.longitude_rad - estimate.position.longitude_rad) +
      N * c * (t.longitude - e.longitude);
  out(2) = -(t.height - e.height);
  out.segment<3>(3) = t.v - e.v;
  // D = C C^': D' = [u - D u^] x D, and phi' equals that rate up to even terms in x.
  const Matrix3d D = truth.C_b_n * estimate.C_b_n.transpose();
  out.segment<3>(6) = t.u - D * e.u;
  return out;
}

TEST(NavigationErrorDynamics, EveryBlockMatchesCentralDifferencesAtRandomStates) {
  test::RandomStates random(21);
  for (int trial = 0; trial < 50; ++trial) {
    const NavigationState state = random.state();
    const InertialRates rates = random.rates();
    const InertialRates measured{rates.omega_ib_b_radps + state.gyro_bias_b_radps,
                                 rates.f_b_mps2 + state.accel_bias_b_mps2};
    Eigen::MatrixXd numeric(9, 15);
    for (int j = 0; j < 15; ++j) {
      const NavigationErrorVector x = step_along(j);
      numeric.col(j) = (error_rate(state, measured, x) - error_rate(state, measured, -x)) / (2.0 * x(j));
    }
    expect_blocks_equal(error_dynamics(state, rates), numeric);
    if (HasFailure()) return;
  }
}

TEST(NavigationErrorDynamics, GravitysChangeWithLatitudeIsIncluded) {
  NavigationState state;
  state.position.latitude_rad = kPi / 4.0;
  const NavigationDynamics F = error_dynamics(state, {});
  // 0.81 mGal per km at 45 degrees: the textbook north-south gradient of normal gravity.
  EXPECT_NEAR(F(kVelocityError + 2, kPositionError), 8.1e-9, 1e-10);
}

NavigationProcessNoise example_noise() { return {1e-4, 2e-3, {3e-4, 200.0}, {0.02, 50.0}}; }

TEST(NavigationTransition, PhiIsTheMatrixExponentialToTheThirdOrder) {
  test::RandomStates random(22);
  constexpr double kDt_s = 0.01;
  for (int trial = 0; trial < 20; ++trial) {
    const NavigationState state = random.state();
    const InertialRates rates = random.rates();
    const NavigationProcessNoise noise = example_noise();
    Eigen::Matrix<double, 15, 15> A = Eigen::Matrix<double, 15, 15>::Zero();
    A.topRows<9>() = error_dynamics(state, rates);
    A.diagonal().segment<3>(9).setConstant(-1.0 / noise.gyro_bias.correlation_time_s);
    A.diagonal().segment<3>(12).setConstant(-1.0 / noise.accel_bias.correlation_time_s);
    const Eigen::Matrix<double, 15, 15> expected = (A * kDt_s).exp();
    const Eigen::Matrix<double, 15, 15> Phi = test::full_matrix(transition(state, rates, noise, kDt_s));
    // What is left out is F^3 dt^3/6: its largest entry is f dt^3/6, tilt rate into position.
    const double left_out = (A * A * A).cwiseAbs().maxCoeff() * kDt_s * kDt_s * kDt_s / 6.0;
    EXPECT_LT((Phi - expected).cwiseAbs().maxCoeff(), 1.01 * left_out);
    EXPECT_LT(left_out, 3e-6);
  }
}

TEST(NavigationTransition, BiasDecayIsExactEvenWhenItIsFasterThanTheStep) {
  NavigationProcessNoise noise = example_noise();
  noise.gyro_bias.correlation_time_s = 1.0 / 113.5;
  const NavigationTransition t = transition({}, {}, noise, 0.01);
  EXPECT_DOUBLE_EQ(t.gyro_bias_decay, std::exp(-1.135));
  // Stationary: decay^2 sigma^2 + q = sigma^2.
  const double q = t.process_covariance(9, 9);
  EXPECT_NEAR(std::exp(-2.27) * 9e-8 + q, 9e-8, 1e-20);
}

TEST(NavigationTransition, ARandomConstantNeitherDecaysNorGrows) {
  NavigationProcessNoise noise = example_noise();
  noise.accel_bias.correlation_time_s = std::numeric_limits<double>::infinity();
  const NavigationTransition t = transition({}, {}, noise, 0.01);
  EXPECT_DOUBLE_EQ(t.accel_bias_decay, 1.0);
  EXPECT_DOUBLE_EQ(t.process_covariance(12, 12), 0.0);
}

/// Blocks of Qd between states that no white noise reaches within two integrations together.
bool begins_with_third_order(int row_block, int column_block) {
  const auto is = [&](int a, int b) {
    return (row_block == a && column_block == b) || (row_block == b && column_block == a);
  };
  return is(0, 0) || is(0, 2) || is(0, 3) || is(0, 4) || is(1, 3);
}

TEST(NavigationTransition, ProcessCovarianceAgreesWithVanLoan) {
  test::RandomStates random(23);
  constexpr double kDt_s = 0.01;
  for (int trial = 0; trial < 10; ++trial) {
    const NavigationState state = random.state();
    const InertialRates rates = random.rates();
    const NavigationProcessNoise noise = example_noise();
    Eigen::Matrix<double, 15, 15> A = Eigen::Matrix<double, 15, 15>::Zero();
    A.topRows<9>() = error_dynamics(state, rates);
    A.diagonal().segment<3>(9).setConstant(-1.0 / noise.gyro_bias.correlation_time_s);
    A.diagonal().segment<3>(12).setConstant(-1.0 / noise.accel_bias.correlation_time_s);
    Eigen::Matrix<double, 15, 15> G = Eigen::Matrix<double, 15, 15>::Zero();
    G.diagonal().segment<3>(3).setConstant(2e-3 * 2e-3);
    G.diagonal().segment<3>(6).setConstant(1e-4 * 1e-4);
    G.diagonal().segment<3>(9).setConstant(2.0 / 200.0 * 9e-8);
    G.diagonal().segment<3>(12).setConstant(2.0 / 50.0 * 4e-4);
    Eigen::Matrix<double, 30, 30> V = Eigen::Matrix<double, 30, 30>::Zero();
    V.topLeftCorner<15, 15>() = -A;
    V.topRightCorner<15, 15>() = G;
    V.bottomRightCorner<15, 15>() = A.transpose();
    const Eigen::Matrix<double, 30, 30> E = (V * kDt_s).exp();
    const Eigen::Matrix<double, 15, 15> expected =
        E.bottomRightCorner<15, 15>().transpose() * E.topRightCorner<15, 15>();
    const NavigationErrorCovariance Q = transition(state, rates, noise, kDt_s).process_covariance;
    // The trapezoid is right to the second order of the step. Entries that begin with its third order come
    // out as dt^3/2 where dt^3/3 is due: they are too large by half, and small beside what they correlate.
    for (int i = 0; i < 15; ++i) {
      for (int j = 0; j < 15; ++j) {
        const double scale = std::sqrt(expected(i, i) * expected(j, j));
        const bool third_order = begins_with_third_order(i / 3, j / 3);
        const double bound = third_order ? 0.51 * std::abs(expected(i, j)) + 1e-5 * scale : 1e-4 * scale;
        EXPECT_NEAR(Q(i, j), expected(i, j), bound) << i << ", " << j;
      }
    }
  }
}

/// N-27: after a manoeuvre of five seconds the sd is what scale and leaning axes make of it.
TEST(NavigationTransition, OwnScaleAndAxesMakeOfATurnWhatTheyMakeOfItsAngle) {
  constexpr double kForEver_s = std::numeric_limits<double>::infinity();
  NavigationProcessNoise noise{0.0, 0.0, {0.0, kForEver_s}, {0.0, kForEver_s}};
  const ReferenceGrade grade{1e-3, 2e-3, 3e-3};
  constexpr double kDt_s = 0.01;
  constexpr int kSteps = 500;
  constexpr double kTurn_radps = 0.3;
  constexpr double kBraking_mps2 = 3.0;
  const NavigationState level;
  const auto sd_after = [&](const InertialRates& rates) {
    NavigationErrorVector variance = NavigationErrorVector::Zero();
    noise.set_motion(grade, level, rates);
    for (int i = 0; i < kSteps; ++i)
      variance += transition(level, rates, noise, kDt_s).process_covariance.diagonal();
    return NavigationErrorVector(variance.cwiseSqrt());
  };
  const double T = kSteps * kDt_s;
  const NavigationErrorVector turned =
      sd_after({Vector3d(0.0, 0.0, kTurn_radps), Vector3d(0.0, 0.0, -kMps2PerG)});
  EXPECT_NEAR(turned(kAttitudeError + 2), 1e-3 * kTurn_radps * T, 1e-2 * 1e-3 * kTurn_radps * T);
  EXPECT_NEAR(turned(kAttitudeError), 2e-3 * kTurn_radps * T, 1e-2 * 2e-3 * kTurn_radps * T);
  const NavigationErrorVector braked =
      sd_after({Vector3d::Zero(), Vector3d(-kBraking_mps2, 0.0, -kMps2PerG)});
  EXPECT_NEAR(braked(kVelocityError), 1e-3 * kBraking_mps2 * T, 1e-2 * 1e-3 * kBraking_mps2 * T);
  const double across = std::hypot(2e-3, 3e-3) * kBraking_mps2 * T;
  EXPECT_NEAR(braked(kVelocityError + 1), across, 1e-2 * across);
  // At rest there is nothing to misread.
  EXPECT_LT(sd_after({Vector3d::Zero(), Vector3d(0.0, 0.0, -kMps2PerG)}).maxCoeff(), 1e-12);
}

TEST(NavigationTransition, ProcessCovarianceIsSymmetricAndPositiveSemiDefinite) {
  test::RandomStates random(24);
  for (int trial = 0; trial < 20; ++trial) {
    const NavigationErrorCovariance Q =
        transition(random.state(), random.rates(), example_noise(), 0.01).process_covariance;
    EXPECT_LT((Q - Q.transpose()).cwiseAbs().maxCoeff(), 1e-24);
    const NavigationErrorVector scale = Q.diagonal().cwiseSqrt().cwiseInverse();
    const NavigationErrorCovariance correlation = scale.asDiagonal() * Q * scale.asDiagonal();
    const Eigen::SelfAdjointEigenSolver<NavigationErrorCovariance> eigen(correlation);
    EXPECT_GT(eigen.eigenvalues()(0), -1e-12);
  }
}

TEST(NavigationTransition, CarriesTheErrorOfARealMechanisationOverTenSeconds) {
  // Truth and estimate are mechanised apart; their difference must be the linear prediction.
  test::RandomStates random(25);
  NavigationState estimate = random.state();
  estimate.position.height_m = 400.0;
  NavigationErrorVector error;
  error << 2.0, -1.0, 1.5, 0.02, -0.01, 0.03, 2e-4, -1e-4, 3e-4, 1e-6, 2e-6, -1e-6, 1e-4, -2e-4, 1e-4;
  NavigationState truth = estimate;
  inject(truth, error);
  NavigationProcessNoise noise;
  noise.gyro_bias.correlation_time_s = std::numeric_limits<double>::infinity();
  noise.accel_bias.correlation_time_s = std::numeric_limits<double>::infinity();
  NavigationErrorVector predicted = error;
  constexpr double kDt_s = 0.01;
  InertialRates previous{Vector3d(0.02, 0.01, 0.2), Vector3d(0.5, -0.3, -9.8)};
  for (int i = 0; i < 1000; ++i) {
    const double t = kDt_s * i;
    const InertialRates now{Vector3d(0.1 * std::sin(t), 0.05 * std::cos(2.0 * t), 0.3 * std::sin(0.5 * t)),
                            Vector3d(std::sin(t), std::cos(0.7 * t), -9.8 + 0.3 * std::sin(5.0 * t))};
    const InertialRates middle{0.5 * (previous.omega_ib_b_radps + now.omega_ib_b_radps),
                               0.5 * (previous.f_b_mps2 + now.f_b_mps2)};
    predicted =
        test::full_matrix(transition(estimate, compensated(middle, estimate), noise, kDt_s)) * predicted;
    propagate(estimate,
              increment_from_samples(compensated(previous, estimate), compensated(now, estimate), kDt_s));
    propagate(truth, increment_from_samples(compensated(previous, truth), compensated(now, truth), kDt_s));
    previous = now;
  }
  const NavigationErrorVector actual = error_between(truth, estimate);
  // Second-order terms: 3e-4 rad squared times 10 m/s^2 over 10 s, and the step's f phi dt/2.
  EXPECT_LT((actual - predicted).segment<3>(0).norm(), 2e-3 * actual.segment<3>(0).norm());
  EXPECT_LT((actual - predicted).segment<3>(3).norm(), 2e-3 * actual.segment<3>(3).norm());
  EXPECT_LT((actual - predicted).segment<3>(6).norm(), 1e-3 * actual.segment<3>(6).norm());
}

TEST(Inject, IsUndoneByErrorBetween) {
  test::RandomStates random(26);
  for (int i = 0; i < 50; ++i) {
    const NavigationState estimate = random.state();
    NavigationErrorVector x;
    x << random.normal3(5.0), random.normal3(0.5), random.normal3(0.02), random.normal3(1e-4),
        random.normal3(1e-2);
    NavigationState truth = estimate;
    inject(truth, x);
    EXPECT_LT((error_between(truth, estimate) - x).cwiseAbs().maxCoeff(), 2e-8);
    EXPECT_LT((error_between(truth, estimate) - x).segment<12>(3).cwiseAbs().maxCoeff(), 1e-14);
  }
}

TEST(Inject, APositionErrorIsInMetresAlongNed) {
  NavigationState estimate;
  estimate.position = {46.52 * kRadPerDeg, 6.57 * kRadPerDeg, 420.0};
  NavigationState truth = estimate;
  NavigationErrorVector x = NavigationErrorVector::Zero();
  x.head<3>() = Vector3d(1.0, -2.0, 3.0);
  inject(truth, x);
  EXPECT_LT((ned_offset(estimate.position, truth.position) - x.head<3>()).norm(), 5e-6);
}

/// Where the antenna really is, by Earth-fixed coordinates.
GeodeticPosition antenna_of(const NavigationState& s, const Vector3d& arm_b) {
  return geodetic_from_ecef(ecef_from_geodetic(s.position) +
                            rotation_ned_to_ecef(s.position.latitude_rad, s.position.longitude_rad) *
                                (s.C_b_n * arm_b));
}

TEST(GnssPosition, JacobianMatchesCentralDifferencesAtRandomStates) {
  test::RandomStates random(27);
  for (int trial = 0; trial < 50; ++trial) {
    const NavigationState estimate = random.state();
    // Far longer than any real arm: Earth-fixed coordinates resolve a nanometre, the bound is 1e-7.
    const Vector3d arm = random.normal3(3000.0);
    Eigen::MatrixXd numeric(3, 15);
    for (int j = 0; j < 15; ++j) {
      const NavigationErrorVector x = step_along(j);
      NavigationState plus = estimate;
      NavigationState minus = estimate;
      inject(plus, x);
      inject(minus, -x);
      numeric.col(j) = (gnss_position_innovation(estimate, antenna_of(plus, arm), arm).innovation -
                        gnss_position_innovation(estimate, antenna_of(minus, arm), arm).innovation) /
                       (2.0 * x(j));
    }
    const Eigen::MatrixXd H = gnss_position_innovation(estimate, estimate.position, arm).H;
    expect_blocks_equal(H, numeric);
    if (HasFailure()) return;
  }
}

TEST(GnssPosition, InnovationIsZeroWhereTheAntennaIsExpected) {
  test::RandomStates random(28);
  const NavigationState state = random.state();
  const Vector3d arm(1.2, -0.3, -1.5);
  EXPECT_LT(gnss_position_innovation(state, antenna_of(state, arm), arm).innovation.norm(), 1e-8);
}

Vector3d antenna_velocity(const NavigationState& s, const Vector3d& omega_measured, const Vector3d& arm) {
  const Matrix3d C_n_b = s.C_b_n.transpose();
  const Vector3d omega_eb_b = omega_measured - s.gyro_bias_b_radps -
                              C_n_b * Vector3d(kEarthRate_radps * std::cos(s.position.latitude_rad), 0.0,
                                               -kEarthRate_radps * std::sin(s.position.latitude_rad));
  return s.v_n_mps + s.C_b_n * omega_eb_b.cross(arm);
}

TEST(GnssVelocity, JacobianMatchesCentralDifferencesAtRandomStates) {
  test::RandomStates random(29);
  for (int trial = 0; trial < 50; ++trial) {
    const NavigationState estimate = random.state();
    const Vector3d arm = random.normal3(2.0);
    const Vector3d omega = random.normal3(0.5);
    Eigen::MatrixXd numeric(3, 15);
    for (int j = 0; j < 15; ++j) {
      const NavigationErrorVector x = step_along(j);
      NavigationState plus = estimate;
      NavigationState minus = estimate;
      inject(plus, x);
      inject(minus, -x);
      numeric.col(j) =
          (antenna_velocity(plus, omega, arm) - antenna_velocity(minus, omega, arm)) / (2.0 * x(j));
    }
    const GnssInnovation model = gnss_velocity_innovation(estimate, Vector3d::Zero(), omega, arm);
    // Earth rate's change over the arm is 1e-11 of the rows' unit entries: rounding hides it in the numbers.
    EXPECT_LT((model.H - numeric).leftCols<3>().cwiseAbs().maxCoeff(), 1e-15);
    expect_blocks_equal(model.H.rightCols<12>(), numeric.rightCols<12>());
    if (HasFailure()) return;
  }
}

TEST(GnssVelocity, AnAntennaAheadSwingsToTheRightInARightTurn) {
  NavigationState state;  // heading north
  const GnssInnovation model = gnss_velocity_innovation(state, Vector3d(0.0, 0.5, 0.0),
                                                        Vector3d(0.0, 0.0, 0.5), Vector3d(1.0, 0.0, 0.0));
  EXPECT_LT(model.innovation.norm(), 2e-4);
}

}  // namespace
}  // namespace imuscope
