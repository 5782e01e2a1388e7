#include "estimation/navigation/so3.h"

#include <gtest/gtest.h>
#include <cmath>
#include <unsupported/Eigen/MatrixFunctions>

#include "tests/estimation/navigation/random_states.h"

namespace imuscope {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

TEST(So3, SkewIsTheCrossProduct) {
  test::RandomStates random(1);
  const Vector3d a = random.normal3(1.0);
  const Vector3d b = random.normal3(1.0);
  EXPECT_LT((skew(a) * b - a.cross(b)).norm(), 1e-15);
}

TEST(So3, ExpIsTheMatrixExponentialFromNanoradiansToFullTurns) {
  test::RandomStates random(2);
  for (const double angle : {0.0, 1e-9, 1e-6, 0.9e-3, 1.1e-3, 0.1, 1.0, 3.0, 3.14159, 6.0}) {
    const Vector3d phi = angle * random.normal3(1.0).normalized();
    const Matrix3d X = skew(phi);
    const Matrix3d expected = X.exp();
    EXPECT_LT((exp_so3(phi) - expected).norm(), 5e-15) << "angle " << angle;
  }
}

TEST(So3, LogUndoesExpUpToHalfATurn) {
  test::RandomStates random(3);
  for (const double angle : {0.0, 1e-12, 1e-6, 0.9e-3, 1.1e-3, 0.1, 1.0, 3.0, kPi - 1e-6, kPi - 1e-12}) {
    for (int i = 0; i < 20; ++i) {
      const Vector3d phi = angle * random.normal3(1.0).normalized();
      EXPECT_LT((log_so3(exp_so3(phi)) - phi).norm(), 1e-14 + 1e-14 * angle) << "angle " << angle;
    }
  }
}

TEST(So3, LogOfHalfATurnIsAnAxisOfThatTurn) {
  for (const Vector3d& axis : {Vector3d(1, 0, 0), Vector3d(0, 1, 0), Vector3d(0, 0, 1)}) {
    const Vector3d phi = log_so3(exp_so3(kPi * axis));
    EXPECT_NEAR(phi.norm(), kPi, 1e-15);
    EXPECT_NEAR(std::abs(phi.dot(axis)), kPi, 1e-14);
  }
}

TEST(So3, EulerAnglesAreHeadingThenPitchThenRoll) {
  const EulerAngles angles{0.1, -0.2, 5.0};
  // The definition: turn about down, then about the new right, then about the new forward.
  const Matrix3d expected = (Eigen::AngleAxisd(angles.heading_rad, Vector3d::UnitZ()) *
                             Eigen::AngleAxisd(angles.pitch_rad, Vector3d::UnitY()) *
                             Eigen::AngleAxisd(angles.roll_rad, Vector3d::UnitX()))
                                .toRotationMatrix();
  EXPECT_LT((rotation_from_euler(angles) - expected).norm(), 1e-15);
}

TEST(So3, EulerAnglesComeBackFromTheirRotation) {
  test::RandomStates random(5);
  for (int i = 0; i < 200; ++i) {
    const EulerAngles in{random.uniform(-3.1, 3.1), random.uniform(-1.57, 1.57), random.uniform(0.0, 6.28)};
    const EulerAngles out = euler_from_rotation(rotation_from_euler(in));
    EXPECT_NEAR(out.roll_rad, in.roll_rad, 1e-12);
    EXPECT_NEAR(out.pitch_rad, in.pitch_rad, 1e-12);
    EXPECT_NEAR(out.heading_rad, in.heading_rad, 1e-12);
  }
}

TEST(So3, NoseStraightUpStillGivesTheSameRotationBack) {
  const Matrix3d C = rotation_from_euler({0.4, kPi / 2.0, 1.0});
  EXPECT_LT((rotation_from_euler(euler_from_rotation(C)) - C).norm(), 1e-9);
}

TEST(So3, ANoseToTheEastHeadsNinetyDegrees) {
  const Matrix3d C = rotation_from_euler({0.0, 0.0, kPi / 2.0});
  EXPECT_LT((C * Vector3d::UnitX() - Vector3d::UnitY()).norm(), 1e-15);
}

TEST(So3, OrthonormalisedRemovesASmallDeformationOnly) {
  const Matrix3d C = exp_so3({0.3, -0.8, 0.5});
  Matrix3d deformed = C;
  deformed(0, 1) += 1e-7;
  const Matrix3d tidy = reorthonormalized(deformed);
  EXPECT_LT((tidy.transpose() * tidy - Matrix3d::Identity()).norm(), 1e-15);
  EXPECT_LT((tidy - C).norm(), 1e-7);
}

TEST(So3, WrappedAnglesLieInTheHalfOpenTurn) {
  EXPECT_NEAR(wrapped_angle(3.5), 3.5 - 2.0 * kPi, 1e-15);
  EXPECT_NEAR(wrapped_angle(-3.5), -3.5 + 2.0 * kPi, 1e-15);
  EXPECT_DOUBLE_EQ(wrapped_angle(kPi), kPi);
  EXPECT_DOUBLE_EQ(wrapped_angle(-kPi), kPi);
}

}  // namespace
}  // namespace imuscope
