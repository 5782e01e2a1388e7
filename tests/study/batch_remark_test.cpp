/// What is said of a batch estimate, and that it is said of no better one: each limit from both sides.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "study/batch_study.h"

namespace imuscope {
namespace {

using batch::BatchMounting;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr double kRadPerDegree = std::numbers::pi / 180.0;

BatchMounting flawless() {
  BatchMounting mounting;
  mounting.covariance.setIdentity();
  mounting.covariance *= 1e-12;
  return mounting;
}

TEST(BatchRemark, NothingIsSaidWhereNothingIsWrong) {
  EXPECT_THAT(batch_remark("mtx1", flawless()), IsEmpty());
}

TEST(BatchRemark, AMountingThatMovedIsToldWithWhenAndHowFar) {
  BatchMounting mounting = flawless();
  mounting.change_s = 312.4;
  mounting.change.difference.head<3>() << 0.0, 1.5 * kRadPerDegree, 2.0 * kRadPerDegree;
  mounting.change.difference.segment<3>(batch::kLeverArm) << 0.03, -0.04, 0.0;
  mounting.change.statistic = 4.99;
  EXPECT_THAT(batch_remark("mtx1", mounting), IsEmpty());
  mounting.change.statistic = 5.01;
  EXPECT_THAT(batch_remark("mtx1", mounting),
              HasSubstr("mtx1: before and after 312 s its mounting differs by 2.5 deg and 50 mm"));
  // It is the most serious of all that may be said.
  mounting.inconsistency = 3.0;
  EXPECT_THAT(batch_remark("mtx1", mounting), HasSubstr("it has moved"));
}

TEST(BatchRemark, PartsThatDisagreeAreToldFromTwiceTheNoiseOn) {
  BatchMounting mounting = flawless();
  mounting.inconsistency = 1.99;
  EXPECT_THAT(batch_remark("mtx1", mounting), IsEmpty());
  mounting.inconsistency = 2.34;
  EXPECT_THAT(batch_remark("mtx1", mounting), HasSubstr("parts of the drive disagree by 2.3 times"));
}

/// Five times the tenth of a degree that data sheets allow.
TEST(BatchRemark, AxesThatLeanAreToldByTheirAngleAndScalesAreNot) {
  for (Eigen::Index departure = 3; departure < 6; ++departure) {
    BatchMounting mounting = flawless();
    mounting.sensor.x.segment<3>(batch::kGyroShape).setConstant(0.05);
    mounting.sensor.x[batch::kGyroShape + departure] = -0.49 * kRadPerDegree;
    EXPECT_THAT(batch_remark("mtx1", mounting), IsEmpty()) << departure;
    mounting.sensor.x[batch::kGyroShape + departure] = -0.55 * kRadPerDegree;
    EXPECT_THAT(batch_remark("mtx1", mounting), HasSubstr("differ from right angles by 0.55 deg"))
        << departure;
  }
}

/// A twentieth of a degree at 5 m/s^2, where it is known to a fifth.
TEST(BatchRemark, AMountThatYieldsIsToldWhereThatIsSure) {
  const double limit = 0.05 * kRadPerDegree / 5.0;
  BatchMounting mounting = flawless();
  mounting.sensor.x[batch::kCompliance + 1] = 0.98 * limit * 0.6;
  mounting.sensor.x[batch::kCompliance + 2] = 0.98 * limit * 0.8;
  EXPECT_THAT(batch_remark("mtx1", mounting), IsEmpty());
  mounting.sensor.x.segment<9>(batch::kCompliance) *= 2.0 / 0.98;
  EXPECT_THAT(batch_remark("mtx1", mounting), HasSubstr("a mount that turns by 0.1 deg"));
  mounting.covariance(batch::kCompliance, batch::kCompliance) = std::pow(2.0 * limit / 4.9, 2);
  EXPECT_THAT(batch_remark("mtx1", mounting), IsEmpty());
  mounting.covariance(batch::kCompliance, batch::kCompliance) = std::pow(2.0 * limit / 5.1, 2);
  EXPECT_THAT(batch_remark("mtx1", mounting), HasSubstr("fasten it more stiffly"));
}

TEST(BatchRemark, TheLowestBandInWhichTheBodyIsNotRigidIsNamed) {
  BatchMounting mounting = flawless();
  for (const double deviation : {0.002, 0.0099, 0.0125, 0.08}) {
    const double from_hz = 2.5 * static_cast<double>(mounting.bands.size());
    mounting.bands.push_back(
        {from_hz, from_hz + 2.5, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), deviation, 1.0});
  }
  EXPECT_THAT(batch_remark("mtx1", mounting), HasSubstr("above 5.0 Hz"));
  EXPECT_THAT(batch_remark("mtx1", mounting), HasSubstr("by 1.2 % of the rates"));
  mounting.bands.resize(2);
  EXPECT_THAT(batch_remark("mtx1", mounting), IsEmpty());
}

}  // namespace
}  // namespace imuscope
