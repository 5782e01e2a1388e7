#include "models/dynamics/covariates.h"
#include "sample/eigen_arrays.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <random>
#include <string>

namespace imuscope {
namespace {

using Eigen::Vector3d;

Vector3d random_vector(std::mt19937& generator) {
  std::normal_distribution<double> normal;
  return {normal(generator), normal(generator), normal(generator)};
}

TEST(Covariates, StandInTheOrderOfTheirNames) {
  ErrorRow row{};
  row.predicted_omega_s_radps = {1, 2, 3};
  row.omega_dot_s_radps2 = {4, 5, 6};
  row.omega_ddot_s_radps3 = {7, 8, 9};
  row.predicted_f_s_mps2 = {10, 11, 12};
  row.f_dot_s_mps3 = {13, 14, 15};
  const auto all = covariates(row);
  for (std::size_t i = 0; i < kCovariates; ++i) EXPECT_EQ(all[i], static_cast<double>(i + 1));
  EXPECT_EQ(covariate_name(0), "omega_x");
  EXPECT_EQ(covariate_name(5), "omega_dot_z");
  EXPECT_EQ(covariate_name(14), "f_dot_z");
  EXPECT_EQ(covariate_unit(11), "m/s^2");
}

// What a small calibration error does to the error process, worked out by vectors, must lie in the span of
// the columns with the coefficients of that error.
TEST(Covariates, CalibrationColumnsCarryWhatCalibrationErrorsProduce) {
  std::mt19937 generator(11);
  for (int round = 0; round < 20; ++round) {
    const Vector3d omega = random_vector(generator);
    const Vector3d omega_dot = random_vector(generator);
    const Vector3d f = 10.0 * random_vector(generator);
    const Vector3d f_dot = random_vector(generator);
    const Vector3d phi = random_vector(generator);  // small rotation of the prediction, in s
    const Vector3d scale = random_vector(generator);
    const double t_d = random_vector(generator).x();
    const Vector3d lever = random_vector(generator);
    ErrorRow row{};
    row.predicted_omega_s_radps = to_array(omega);
    row.omega_dot_s_radps2 = to_array(omega_dot);
    row.predicted_f_s_mps2 = to_array(f);
    row.f_dot_s_mps3 = to_array(f_dot);
    const Vector3d gyro = phi.cross(omega) + scale.cwiseProduct(omega) + t_d * omega_dot;
    const Vector3d accel = phi.cross(f) + scale.cwiseProduct(f) + t_d * f_dot + omega_dot.cross(lever) +
                           omega.cross(omega.cross(lever));
    for (std::size_t axis = 0; axis < 6; ++axis) {
      std::array<double, kAccelCalibrationColumns> c{};
      calibration_columns(row, axis, c);
      const auto i = static_cast<Eigen::Index>(axis % 3);
      const Eigen::Index j = (i + 1) % 3;
      const Eigen::Index k = (i + 2) % 3;
      double value = -phi(k) * c[0] + phi(j) * c[1] + scale(i) * c[2] + t_d * c[3];
      if (axis >= 3) value += lever.x() * c[4] + lever.y() * c[5] + lever.z() * c[6];
      EXPECT_NEAR(value, axis < 3 ? gyro(i) : accel(i), 1e-12) << "axis " << axis;
    }
  }
}

TEST(Covariates, CountsWhatProjectionTakesAway) {
  for (std::size_t axis = 0; axis < 6; ++axis) {
    int taken = 0;
    for (std::size_t i = 0; i < kCovariates; ++i) taken += is_calibration_column(axis, i) ? 1 : 0;
    EXPECT_EQ(taken, 4);
  }
  EXPECT_TRUE(is_calibration_column(0, 3));   // omega_dot_x on gyro_x: time offset
  EXPECT_FALSE(is_calibration_column(0, 4));  // omega_dot_y on gyro_x
  EXPECT_FALSE(is_calibration_column(0, 9));  // f_x on gyro_x: g-sensitivity
  EXPECT_TRUE(is_calibration_column(3, 10));  // f_y on accel_x: misalignment
  EXPECT_FALSE(is_calibration_column(3, 0));  // omega_x on accel_x
}

}  // namespace
}  // namespace imuscope
