#include "results/report/mounting.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/units.h"

namespace imuscope::report {
namespace {

/// A rotation of b by `angle_deg` about z: the components of a fixed vector seen from the turned axes.
Rotation turned_about_z(double angle_deg) {
  const double c = std::cos(angle_deg * kRadPerDeg);
  const double s = std::sin(angle_deg * kRadPerDeg);
  return {c, s, 0, -s, c, 0, 0, 0, 1};
}

constexpr Rotation kSame{1, 0, 0, 0, 1, 0, 0, 0, 1};

TEST(Mounting, SensorTurnedPositivelyAboutZHasPositivePsiZ) {
  // C_b_s = Exp(-psi) seen from C_prior = I, and turned axes see a vector through Exp(-angle).
  const Angles psi = boresight_deg(kSame, turned_about_z(0.25));
  EXPECT_NEAR(psi[0], 0.0, 1e-12);
  EXPECT_NEAR(psi[1], 0.0, 1e-12);
  EXPECT_NEAR(psi[2], 0.25, 1e-12);
}

TEST(Mounting, LogIsRightFromTinyAnglesToAlmostHalfATurn) {
  for (const double angle : {1e-9, 1e-3, 1.0, 89.0, 91.0, 150.0, 179.999}) {
    EXPECT_NEAR(boresight_deg(kSame, turned_about_z(angle))[2], angle, 1e-9 + 1e-9 * angle) << angle;
  }
}

TEST(Mounting, NearestSquareMountingIsFoundThroughTwentyDegrees) {
  for (const double right_angle : {0.0, 90.0, 180.0, 270.0}) {
    const Rotation square = nearest_square_mounting(turned_about_z(right_angle + 20.0));
    const Rotation expected = turned_about_z(right_angle);
    for (std::size_t i = 0; i < square.size(); ++i) EXPECT_NEAR(square[i], expected[i], 1e-12) << right_angle;
  }
}

TEST(Mounting, WordsSayWhereEachAxisPoints) {
  EXPECT_EQ(square_mounting_words(turned_about_z(0.0)), "x along +x, y along +y, z along +z");
  EXPECT_EQ(square_mounting_words(nearest_square_mounting(turned_about_z(90.0))),
            "x along +y, y along −x, z along +z");
}

}  // namespace
}  // namespace imuscope::report
