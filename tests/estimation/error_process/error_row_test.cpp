#include "estimation/error_process/error_row.h"
#include "sample/eigen_arrays.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <random>

namespace imuscope {
namespace {

using Eigen::Vector3d;

/// A point fixed to a body that turns by a known rotation R(t) about a moving origin: its acceleration by
/// numerical differentiation of its position is the independent check of the lever-arm terms.
struct TurningBody {
  static Eigen::Matrix3d R(double t) {
    return (Eigen::AngleAxisd(0.7 * std::sin(1.3 * t), Vector3d::UnitZ()) *
            Eigen::AngleAxisd(0.3 * std::cos(0.9 * t), Vector3d::UnitY()) *
            Eigen::AngleAxisd(0.2 * t, Vector3d::UnitX()))
        .toRotationMatrix();
  }
  static Vector3d origin(double t) { return {3.0 * std::sin(0.5 * t), 2.0 * t, std::cos(t)}; }
  static Vector3d point(double t, const Vector3d& r_b) { return origin(t) + R(t) * r_b; }

  static constexpr double kStep_s = 1e-4;

  static Vector3d acceleration(double t, const Vector3d& r_b) {
    return (point(t + kStep_s, r_b) - 2.0 * point(t, r_b) + point(t - kStep_s, r_b)) / (kStep_s * kStep_s);
  }
  static Vector3d omega_b(double t) {
    const Eigen::Matrix3d W = R(t).transpose() * (R(t + kStep_s) - R(t - kStep_s)) / (2.0 * kStep_s);
    return {W(2, 1), W(0, 2), W(1, 0)};
  }
  static Vector3d omega_dot_b(double t) {
    return (omega_b(t + kStep_s) - omega_b(t - kStep_s)) / (2.0 * kStep_s);
  }
};

SImuEpoch epoch_at(double t, const Eigen::Matrix3d& C_b_s, const Vector3d& r_b, const Vector3d& error_gyro,
                   const Vector3d& error_accel) {
  SImuEpoch epoch{};
  epoch.omega_ib_b_radps = to_array(TurningBody::omega_b(t));
  epoch.omega_dot_ib_b_radps2 = to_array(TurningBody::omega_dot_b(t));
  epoch.f_b_mps2 = to_array(TurningBody::R(t).transpose() * TurningBody::acceleration(t, Vector3d::Zero()));
  epoch.sample.omega_radps = to_array(C_b_s * TurningBody::omega_b(t) + error_gyro);
  epoch.sample.f_mps2 =
      to_array(C_b_s * TurningBody::R(t).transpose() * TurningBody::acceleration(t, r_b) + error_accel);
  epoch.sample.flags = kGyroValid | kAccelValid;
  return epoch;
}

Matrix3 row_major(const Eigen::Matrix3d& C) {
  Matrix3 m{};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) m[static_cast<std::size_t>(3 * i + j)] = C(i, j);
  }
  return m;
}

TEST(ErrorRow, OfAPointOnATurningBodyIsTheErrorThatWasPutIn) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  for (int trial = 0; trial < 50; ++trial) {
    const Eigen::Matrix3d C =
        Eigen::Quaterniond{normal(random), normal(random), normal(random), normal(random)}
            .normalized()
            .toRotationMatrix();
    const Vector3d r_b{normal(random), normal(random), normal(random)};
    const Vector3d e_g(0.01, -0.02, 0.03);
    const Vector3d e_a(-0.1, 0.2, 0.3);
    const auto row = error_row(epoch_at(0.1 * trial, C, r_b, e_g, e_a), {row_major(C), to_array(r_b)}, {});
    for (int i = 0; i < 3; ++i) {
      EXPECT_NEAR(row.e_gyro_radps[static_cast<std::size_t>(i)], e_g[i], 1e-12);
      // Second differences of a 1e-4 s step carry rounding of order 1e-16 * 100 m / 1e-8 s^2.
      EXPECT_NEAR(row.e_accel_mps2[static_cast<std::size_t>(i)], e_a[i], 1e-5);
    }
  }
}

TEST(ErrorRow, BearsTheDerivativesInTheAxesOfTheSensor) {
  SImuEpoch epoch{};
  epoch.time = HostTime{} + Duration{1234};
  epoch.regime = Regime::kDynamic;
  epoch.omega_dot_ib_b_radps2 = {1.0, 2.0, 3.0};
  epoch.omega_ddot_ib_b_radps3 = {4.0, 5.0, 6.0};
  epoch.f_dot_b_mps3 = {7.0, 8.0, 9.0};
  // A quarter turn about z takes y of b to x of s.
  const auto row = error_row(epoch, {{0, 1, 0, -1, 0, 0, 0, 0, 1}, {}}, {});
  EXPECT_EQ(row.omega_dot_s_radps2, (Vector3{2.0, -1.0, 3.0}));
  EXPECT_EQ(row.omega_ddot_s_radps3, (Vector3{5.0, -4.0, 6.0}));
  EXPECT_EQ(row.f_dot_s_mps3, (Vector3{8.0, -7.0, 9.0}));
  EXPECT_EQ(row.time, epoch.time);
  EXPECT_EQ(row.regime, epoch.regime);
}

TEST(ErrorRow, TakesTheReferenceBiasOfTheCallersChoice) {
  SImuEpoch epoch{};
  epoch.sample.flags = kGyroValid | kAccelValid;
  epoch.omega_ib_b_radps = {1.0, 0.0, 0.0};  // compensated with 0.1
  epoch.reference_gyro_bias_radps = {0.1, 0.0, 0.0};
  const auto row = error_row(epoch, {}, {{0.25, 0.0, 0.0}, {}});
  // Raw rate 1.1, less 0.25.
  EXPECT_DOUBLE_EQ(row.predicted_omega_s_radps[0], 0.85);
  EXPECT_DOUBLE_EQ(row.e_gyro_radps[0], -0.85);
}

TEST(ErrorRow, AClippedTriadIsNotValid) {
  SImuEpoch epoch{};
  epoch.sample.flags = kGyroValid | kAccelValid | kAccelClipY;
  const auto row = error_row(epoch, {}, {});
  EXPECT_TRUE(row.gyro_valid);
  EXPECT_FALSE(row.accel_valid);
}

TEST(ErrorRow, WithoutScaleErrorTheRemainderNoLongerFollowsThePrediction) {
  ErrorRow row{};
  row.predicted_omega_s_radps = {2.0, -1.0, 0.5};
  row.e_gyro_radps = {2.0 * 0.003 + 0.1, 1.0 * 0.003 + 0.1, 0.1};
  const auto corrected = without_scale_error(row, {{0.003, -0.003, 0.0}, {}});
  for (const double e : corrected.e_gyro_radps) EXPECT_NEAR(e, 0.1, 1e-15);
}

TEST(ErrorRow, LiveIsThatOfTheEstimateAsItStood) {
  SImuEpoch epoch{};
  epoch.sample.flags = kGyroValid | kAccelValid;
  epoch.sample.counter = 77;
  epoch.sample.omega_radps = {0.5, 0.0, 0.0};
  epoch.sample.f_mps2 = {0.0, 0.0, -9.0};
  // A quarter turn about z takes y of b to x of s; one metre along x of b, turning about z at 2 rad/s.
  epoch.C_b_s = {0, 1, 0, -1, 0, 0, 0, 0, 1};
  epoch.r_bs_b_m = {1.0, 0.0, 0.0};
  epoch.omega_ib_b_radps = {0.0, 0.0, 2.0};
  epoch.f_b_mps2 = {0.0, 0.0, -9.8};
  epoch.reference_gyro_bias_radps = {0.3, 0.2, 0.1};
  epoch.reference_accel_bias_mps2 = {0.3, 0.2, 0.1};
  const auto row = live_error_row(epoch);
  EXPECT_EQ(row.counter, 77);
  EXPECT_EQ(row.predicted_omega_s_radps, (Vector3{0.0, 0.0, 2.0}))
      << "the epoch's reference has its bias taken out";
  EXPECT_EQ(row.e_gyro_radps, (Vector3{0.5, 0.0, -2.0}));
  // Centripetal: omega^2 r towards the middle, along -x of b, which is y of s.
  EXPECT_NEAR(row.predicted_f_s_mps2[0], 0.0, 1e-12);
  EXPECT_NEAR(row.predicted_f_s_mps2[1], 4.0, 1e-12);
  EXPECT_NEAR(row.predicted_f_s_mps2[2], -9.8, 1e-12);
  EXPECT_NEAR(row.e_accel_mps2[2], 0.8, 1e-12);
}

}  // namespace
}  // namespace imuscope
