#include <gtest/gtest.h>
#include <cmath>

#include "base/units.h"
#include "estimation/batch/sensor_model.h"

namespace imuscope::batch {
namespace {

SensorClass of_reference(double white_deg_per_sqrt_h) {
  SensorClass sensor;
  sensor.reference = reference_grade(white_deg_per_sqrt_h * kRadPerDeg / 60.0);
  return sensor;
}

TEST(SensorClass, AReferenceIsBelievedByItsGrade) {
  const SensorClass navigation;
  for (const double quieter : {0.0015, 0.005}) {
    const SensorClass sensor = of_reference(quieter);
    EXPECT_NEAR(sensor.reference.scale_sd, navigation.reference.scale_sd, 1e-12);
    EXPECT_NEAR(sensor.reference.axis_sd_rad, navigation.reference.axis_sd_rad, 1e-12);
    EXPECT_NEAR(sensor.reference.triad_sd_rad, navigation.reference.triad_sd_rad, 1e-12);
  }
  const SensorClass tactical = of_reference(0.15);
  EXPECT_NEAR(tactical.reference.scale_sd, 1e-3, 1e-9);
  EXPECT_NEAR(tactical.reference.triad_sd_rad, 0.05 * kRadPerDeg, 1e-9);
  EXPECT_NEAR(tactical.reference.axis_sd_rad, 0.05 * kRadPerDeg / std::sqrt(2.0), 1e-9);
  for (const double louder : {0.3, 4.8}) {
    const SensorClass sensor = of_reference(louder);
    EXPECT_NEAR(sensor.reference.scale_sd, 5e-3, 1e-9);
    EXPECT_NEAR(sensor.reference.axis_sd_rad, sensor.axis_sd_rad / std::sqrt(2.0), 1e-9);
    EXPECT_NEAR(sensor.reference.triad_sd_rad, sensor.triad_sd_rad, 1e-9);
  }
}

/// Half-way in the logarithm of the noise is half-way in that of what is believed.
TEST(SensorClass, BetweenTwoGradesTheBeliefIsBetweenTheirs) {
  EXPECT_NEAR(of_reference(std::sqrt(0.15 * 0.3)).reference.scale_sd, std::sqrt(1e-3 * 5e-3), 1e-9);
  EXPECT_NEAR(of_reference(std::sqrt(0.005 * 0.15)).reference.scale_sd, std::sqrt(3e-4 * 1e-3), 1e-9);
  double before = 0.0;
  for (double white = 0.001; white < 10.0; white *= 1.1) {
    const double scale = of_reference(white).reference.scale_sd;
    EXPECT_GE(scale, before);
    before = scale;
  }
}

/// b is what the reference's gyros say: axes that lean towards each other make their triad crooked, and no more.
TEST(SensorClass, CrookedAxesOfTheReferenceDoNotTurnItsFrame) {
  const SensorClass sensor = of_reference(0.3);
  SensorState state;
  state.above = 0.5;
  const auto factor = of_reference_axes(sensor, state);
  const Eigen::Matrix<double, kParameters, kParameters> covariance = factor * factor.transpose();
  const double departure_sd_rad = std::sqrt(2.0) * sensor.reference.axis_sd_rad;
  for (Eigen::Index i = 3; i < 6; ++i) {
    EXPECT_NEAR(std::sqrt(covariance(kGyroShape + i, kGyroShape + i)), departure_sd_rad,
                1e-3 * departure_sd_rad);
    EXPECT_NEAR(std::sqrt(covariance(kAccelShape + i, kAccelShape + i)), departure_sd_rad,
                1e-3 * departure_sd_rad);
  }
  // What is published follows the x gyro (B-24), which leans by half of each departure.
  for (Eigen::Index i = 0; i < 3; ++i) {
    EXPECT_NEAR(std::sqrt(covariance(kPsi + i, kPsi + i)), 0.5 * departure_sd_rad, 1e-3 * departure_sd_rad);
    // Both triads are crooked, each by itself, and they are turned against each other.
    EXPECT_NEAR(std::sqrt(covariance(kAlpha + i, kAlpha + i)),
                std::hypot(sensor.reference.triad_sd_rad, std::sqrt(0.5) * departure_sd_rad),
                1e-3 * departure_sd_rad);
  }
}

}  // namespace
}  // namespace imuscope::batch
