#include "estimation/navigation/odometry_measurement.h"

#include <gtest/gtest.h>
#include <cmath>

#include "estimation/navigation/so3.h"
#include "estimation/navigation/wgs84.h"
#include "tests/estimation/navigation/random_states.h"

namespace imuscope {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kRelativeDifference = 1e-7;

struct Scene {
  NavigationState state;
  OdometryState odometry;
  Vector3d omega;
};

Scene random_scene(test::RandomStates& random) {
  Scene scene;
  scene.state = random.state();
  scene.odometry.C_b_v = exp_so3(random.normal3(0.3));
  scene.odometry.r_bv_b_m = random.normal3(1.5);
  scene.odometry.scale = random.normal(0.05);
  scene.omega = random.normal3(0.5);
  return scene;
}

/// What the wheels show and how the axle moves, written down once more in Earth-fixed terms: the velocity of
/// the axle is that of b plus the swing of the arm, both relative to the Earth.
Vector3d shown(const NavigationState& s, const OdometryState& o, const Vector3d& omega_measured) {
  const double L = s.position.latitude_rad;
  const Vector3d w_ie(kEarthRate_radps * std::cos(L), 0.0, -kEarthRate_radps * std::sin(L));
  const Vector3d w_eb_n = s.C_b_n * (omega_measured - s.gyro_bias_b_radps) - w_ie;
  const Vector3d v_axle_n = s.v_n_mps + w_eb_n.cross(s.C_b_n * o.r_bv_b_m);
  Vector3d v = o.C_b_v * (s.C_b_n.transpose() * v_axle_n);
  v.x() *= 1.0 + o.scale;
  return v;
}

void expect_block(const Eigen::MatrixXd& analytic, const Eigen::MatrixXd& numeric, const char* name,
                  double row_scale) {
  const double largest = analytic.cwiseAbs().maxCoeff();
  const double difference = (analytic - numeric).cwiseAbs().maxCoeff();
  EXPECT_LE(difference, largest > 0.0 ? kRelativeDifference * largest : 1e-12 * row_scale)
      << name << "\nanalytic\n"
      << analytic << "\nnumeric\n"
      << numeric;
}

TEST(OdometryMeasurement, JacobianMatchesCentralDifferencesAtRandomStates) {
  // Long enough for rounding, short enough for the third order.
  constexpr std::array<double, 5> kSteps{100.0, 1.0, 1e-4, 1e-3, 1e-3};
  constexpr std::array<const char*, 5> kNames{"dr", "dv", "phi", "db_g", "db_a"};
  test::RandomStates random(41);
  for (int trial = 0; trial < 200; ++trial) {
    const Scene scene = random_scene(random);
    const OdometryInnovation model = odometry_innovation(scene.state, scene.odometry, 0.0, scene.omega);
    Eigen::MatrixXd numeric(3, kNavigationErrorSize);
    for (int j = 0; j < kNavigationErrorSize; ++j) {
      NavigationErrorVector x = NavigationErrorVector::Zero();
      x(j) = kSteps[static_cast<std::size_t>(j / 3)];
      NavigationState plus = scene.state;
      NavigationState minus = scene.state;
      inject(plus, x);
      inject(minus, -x);
      numeric.col(j) =
          (shown(plus, scene.odometry, scene.omega) - shown(minus, scene.odometry, scene.omega)) /
          (2.0 * x(j));
    }
    // Earth rate's change over the arm is 1e-11 of the rows' unit entries: rounding hides it in the numbers.
    EXPECT_LT((model.H - numeric).leftCols<3>().cwiseAbs().maxCoeff(), 1e-15);
    for (int block = 1; block < 5; ++block)
      expect_block(model.H.middleCols<3>(3 * block), numeric.middleCols<3>(3 * block),
                   kNames[static_cast<std::size_t>(block)], model.H.cwiseAbs().maxCoeff());

    Eigen::MatrixXd numeric_odometry(3, kOdometryErrorSize);
    constexpr std::array<double, kOdometryErrorSize> kOdometrySteps{1e-2, 1e-4, 1e-4, 1.0, 1.0, 1.0};
    for (int j = 0; j < kOdometryErrorSize; ++j) {
      OdometryErrorVector x = OdometryErrorVector::Zero();
      x(j) = kOdometrySteps[static_cast<std::size_t>(j)];
      OdometryState plus = scene.odometry;
      OdometryState minus = scene.odometry;
      inject(plus, x);
      inject(minus, -x);
      numeric_odometry.col(j) =
          (shown(scene.state, plus, scene.omega) - shown(scene.state, minus, scene.omega)) / (2.0 * x(j));
    }
    const double scale = model.H_odometry.cwiseAbs().maxCoeff();
    expect_block(model.H_odometry.col(0), numeric_odometry.col(0), "scale", scale);
    expect_block(model.H_odometry.middleCols<2>(1), numeric_odometry.middleCols<2>(1), "mounting", scale);
    expect_block(model.H_odometry.middleCols<3>(3), numeric_odometry.middleCols<3>(3), "lever arm", scale);
    if (HasFailure()) return;
  }
}

TEST(OdometryMeasurement, InnovationIsWhatTheWheelsShowTooMuchAndTheSlip) {
  test::RandomStates random(42);
  for (int trial = 0; trial < 50; ++trial) {
    const Scene scene = random_scene(random);
    const Vector3d expected = shown(scene.state, scene.odometry, scene.omega);
    const OdometryInnovation model =
        odometry_innovation(scene.state, scene.odometry, expected.x() + 0.25, scene.omega);
    EXPECT_NEAR(model.innovation.x(), 0.25, 1e-12);
    EXPECT_NEAR(model.innovation.y(), -expected.y(), 1e-12);
    EXPECT_NEAR(model.innovation.z(), -expected.z(), 1e-12);
  }
}

// North at 10 m/s, turning right at 0.5 rad/s: a point 2 m behind b moves to the left of b's velocity.
TEST(OdometryMeasurement, APointBehindSwingsOutwardsInATurn) {
  NavigationState state;
  state.v_n_mps = {10.0, 0.0, 0.0};
  OdometryState odometry;
  odometry.r_bv_b_m = {-2.0, 0.0, 0.0};
  const OdometryInnovation model = odometry_innovation(state, odometry, 10.0, {0.0, 0.0, 0.5});
  EXPECT_NEAR(model.predicted.x(), 10.0, 1e-3);
  EXPECT_NEAR(model.predicted.y(), -1.0, 1e-3);
}

TEST(OdometryMeasurement, ZeroVelocityJacobianIsThatOfTheVelocity) {
  test::RandomStates random(43);
  const NavigationState estimate = random.state();
  const ZeroVelocityInnovation model = zero_velocity_innovation(estimate);
  for (int j = 0; j < kNavigationErrorSize; ++j) {
    NavigationErrorVector x = NavigationErrorVector::Zero();
    x(j) = 1e-3;
    NavigationState truth = estimate;
    inject(truth, x);
    // Truth stands: what is measured is 0, and the estimate is off by x.
    const Vector3d slope = (truth.v_n_mps - estimate.v_n_mps) / 1e-3;
    EXPECT_LT((model.H.col(j) - slope).norm(), 1e-9) << j;
  }
  EXPECT_EQ(model.innovation, -estimate.v_n_mps);
}

}  // namespace
}  // namespace imuscope
