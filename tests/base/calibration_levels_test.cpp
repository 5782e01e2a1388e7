#include "base/calibration_levels.h"

#include <gtest/gtest.h>
#include <limits>

namespace imuscope {
namespace {

constexpr MountingGoal kGoal{1e-3, 2e-3, 1e-4};
constexpr std::array kGoalBoresight{1e-3, 1e-3, 1e-3};
constexpr std::array kGoalLeverArm{2e-3, 2e-3, 2e-3};
constexpr double kJustAbove = 1.0 + 1e-12;

TEST(CalibrationLevels, AnEstimateIsThereFromConvergingOnByEnumKeyAndWords) {
  EXPECT_FALSE(has_estimate(CalibrationStatus::kWaiting));
  EXPECT_FALSE(has_estimate(CalibrationStatus::kCoarse));
  EXPECT_TRUE(has_estimate(CalibrationStatus::kConverging));
  EXPECT_TRUE(has_estimate(CalibrationStatus::kCalibrated));
  for (const auto status : {CalibrationStatus::kWaiting, CalibrationStatus::kCoarse,
                            CalibrationStatus::kConverging, CalibrationStatus::kCalibrated}) {
    EXPECT_EQ(has_estimate(key_of(status)), has_estimate(status));
    EXPECT_EQ(has_estimate(words_of(status)), has_estimate(status));
  }
  EXPECT_FALSE(has_estimate(""));
}

TEST(CalibrationLevels, EveryAxisHasToMeetTheGoal) {
  EXPECT_TRUE(meets_goal(kGoalBoresight, kGoalLeverArm, kGoal));
  for (std::size_t i = 0; i < 3; ++i) {
    auto boresight = kGoalBoresight;
    boresight[i] *= kJustAbove;
    EXPECT_FALSE(meets_goal(boresight, kGoalLeverArm, kGoal)) << i;
    auto lever_arm = kGoalLeverArm;
    lever_arm[i] *= kJustAbove;
    EXPECT_FALSE(meets_goal(kGoalBoresight, lever_arm, kGoal)) << i;
    lever_arm[i] = std::numeric_limits<double>::quiet_NaN();
    EXPECT_FALSE(meets_goal(kGoalBoresight, lever_arm, kGoal)) << i;
  }
}

TEST(CalibrationLevels, GoalsFollowFromTheSensorsNoiseAndFromItsAxes) {
  constexpr double kDeg = kPi / 180.0;
  // A quarter of what 0.04 deg/s per sqrt(Hz) leaves in a mean of 4 s is 0.005 deg/s: of 0.1 rad/s and
  // rad/s^2.
  SensorQuality mems{0.04 * kDeg, 2e-3, 0.0, 0.0};
  EXPECT_NEAR(goal_of(mems).boresight_sd_rad, 0.05 * kDeg, 1e-12);
  EXPECT_NEAR(goal_of(mems).lever_arm_sd_m, 0.25e-3 / 0.2, 1e-12);
  EXPECT_NEAR(goal_of(mems).time_offset_sd_s, 0.05 * kDeg, 1e-12);
  mems.axes_sd_rad = 0.07 * kDeg;
  mems.places_sd_m = 5e-3;
  EXPECT_NEAR(goal_of(mems).boresight_sd_rad, 0.07 * kDeg, 1e-12) << "no better than its axes are straight";
  EXPECT_NEAR(goal_of(mems).lever_arm_sd_m, 5e-3, 1e-12);
  EXPECT_EQ(goal_of(SensorQuality{}), kFinestGoal);
  EXPECT_EQ(goal_of({1.0, 1.0, 1.0, 1.0}), kUsableGoal) << "never worse than what is usable";
}

TEST(CalibrationLevels, UsableIsATenthOfADegreeACentimetreAndAMillisecond) {
  constexpr double kTenthOfDegree_rad = 0.1 * kRadPerDeg;
  EXPECT_TRUE(is_usable(0.999 * kTenthOfDegree_rad, 0.999e-2, 0.999e-3));
  EXPECT_FALSE(is_usable(1.001 * kTenthOfDegree_rad, 0.999e-2, 0.999e-3));
  EXPECT_FALSE(is_usable(0.999 * kTenthOfDegree_rad, 1.001e-2, 0.999e-3));
  EXPECT_FALSE(is_usable(0.999 * kTenthOfDegree_rad, 0.999e-2, 1.001e-3));
}

TEST(CalibrationLevels, OneScaleSaysWhatAPersonMayDoWithAMounting) {
  constexpr double kDeg = kPi / 180.0;
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(usability_of(0.09 * kDeg, 0.009, 0.9e-3), Usability::kUsable);
  EXPECT_EQ(usability_of(0.2 * kDeg, 0.009, 0.9e-3), Usability::kWithLimits);
  EXPECT_EQ(usability_of(0.09 * kDeg, 0.5, 0.9e-3), Usability::kWithLimits);
  EXPECT_EQ(usability_of(0.09 * kDeg, 0.009, kUnknown), Usability::kWithLimits);
  EXPECT_EQ(usability_of(1.1 * kDeg, 0.009, 0.9e-3), Usability::kNotUsable);
  EXPECT_EQ(usability_of(kUnknown, kUnknown, kUnknown), Usability::kNotUsable);
  EXPECT_EQ(words_of(Usability::kWithLimits), "usable with limits");
}

}  // namespace
}  // namespace imuscope
