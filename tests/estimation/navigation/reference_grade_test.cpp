#include "estimation/navigation/reference_grade.h"

#include <gtest/gtest.h>
#include <cmath>

#include "base/units.h"

namespace imuscope {
namespace {

ReferenceGrade of_reference(double white_deg_per_sqrt_h) {
  return reference_grade(white_deg_per_sqrt_h * kRadPerDeg / 60.0);
}

TEST(ReferenceGrade, IsBelievedByTheNoiseOfTheGyros) {
  for (const double quieter : {0.0015, 0.005}) {
    const ReferenceGrade grade = of_reference(quieter);
    EXPECT_NEAR(grade.scale_sd, 3e-4, 1e-12);
    EXPECT_NEAR(grade.lean_sd_rad, 1.5e-4, 1e-12);
    EXPECT_NEAR(grade.triad_sd_rad, 3e-4, 1e-12);
  }
  const ReferenceGrade tactical = of_reference(0.15);
  EXPECT_NEAR(tactical.scale_sd, 1e-3, 1e-9);
  EXPECT_NEAR(tactical.triad_sd_rad, 0.05 * kRadPerDeg, 1e-9);
  EXPECT_NEAR(tactical.lean_sd_rad, 0.025 * kRadPerDeg, 1e-9);
  for (const double louder : {0.3, 4.8}) {
    const ReferenceGrade grade = of_reference(louder);
    EXPECT_NEAR(grade.scale_sd, 5e-3, 1e-9);
    EXPECT_NEAR(grade.lean_sd_rad, 0.05 * kRadPerDeg, 1e-9);
    EXPECT_NEAR(grade.triad_sd_rad, 0.1 * kRadPerDeg, 1e-9);
  }
}

/// Half-way in the logarithm of the noise is half-way in that of what is believed.
TEST(ReferenceGrade, BetweenTwoKnownOnesIsBetweenThem) {
  EXPECT_NEAR(of_reference(std::sqrt(0.15 * 0.3)).scale_sd, std::sqrt(1e-3 * 5e-3), 1e-9);
  EXPECT_NEAR(of_reference(std::sqrt(0.005 * 0.15)).scale_sd, std::sqrt(3e-4 * 1e-3), 1e-9);
  double before = 0.0;
  for (double white = 0.001; white < 10.0; white *= 1.1) {
    const double scale = of_reference(white).scale_sd;
    EXPECT_GE(scale, before);
    before = scale;
  }
}

}  // namespace
}  // namespace imuscope
