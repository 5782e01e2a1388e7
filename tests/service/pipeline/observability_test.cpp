#include "service/pipeline/observability.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <cmath>

#include "base/units.h"

namespace imuscope {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

/// Everything at its goal.
SImuOutput calibrated() {
  SImuOutput study;
  study.status = CalibrationStatus::kCalibrated;
  study.sd_psi_rad.fill(0.005 * kRadPerDeg);
  study.sd_r_bs_b_m.fill(5e-4);
  study.sd_t_d_s = 3e-5;
  study.observable.fill(true);
  study.t_d_observable = true;
  study.weakest_direction = {0, 1, 0, 0, 0, 0};
  study.weakest_relative_sd = 0.01;
  return study;
}

TEST(Observability, WithEveryGoalReachedGivesNumbersAndNoAdvice) {
  const Observability all = observability_of(calibrated());
  for (const auto& state : all.states) EXPECT_TRUE(state.reached()) << state.name;
  EXPECT_EQ(all.weakest, "boresight about right");
  EXPECT_THAT(all.advice, IsEmpty());
  const auto json = observability_json(all);
  EXPECT_EQ(json.at("states").size(), kObservedStates);
  EXPECT_NEAR(json.at("states").at(0).at("sd").get<double>(), 0.005, 1e-12);
  EXPECT_EQ(json.at("states").at(3).at("goal"), 1e-3);
  EXPECT_TRUE(json.at("advice").is_null());
}

TEST(Observability, AtStandstillSaysThatTheAngleAboutGravityIsNotObservableAndWhatWouldShowIt) {
  SImuOutput study = calibrated();
  study.status = CalibrationStatus::kConverging;
  study.sd_psi_rad[2] = 2.0 * kRadPerDeg;
  study.observable[2] = false;
  study.weakest_direction = {0.02, -0.01, 0.999, 0, 0, 0};
  study.weakest_relative_sd = 0.999;
  const Observability found = observability_of(study);
  EXPECT_EQ(found.weakest, "boresight about down");
  EXPECT_THAT(found.advice, HasSubstr("brake"));
  const auto json = observability_json(found);
  EXPECT_EQ(json.at("states").at(2).at("text"), kNotObservable);
  EXPECT_FALSE(json.at("weakest").at("observable").get<bool>());
}

TEST(Observability, TranslatesADirectionBetweenAxesAndAMixedOne) {
  SImuOutput study = calibrated();
  const double c = std::cos(30.0 * kRadPerDeg);
  const double s = std::sin(30.0 * kRadPerDeg);
  study.weakest_direction = {c, 0, s, 0, 0, 0};
  EXPECT_EQ(observability_of(study).weakest, "boresight about an axis 30 deg from forward towards down");
  // An eigenvector's sign says nothing: the same axis.
  study.weakest_direction = {-c, 0, -s, 0, 0, 0};
  EXPECT_EQ(observability_of(study).weakest, "boresight about an axis 30 deg from forward towards down");
  study.weakest_direction = {c, 0, -s, 0, 0, 0};
  EXPECT_EQ(observability_of(study).weakest, "boresight about an axis 30 deg from forward towards up");
  study.weakest_direction = {0, 0, 0, 0, 0, 1};
  EXPECT_EQ(observability_of(study).weakest, "lever arm along down");
  study.weakest_direction = {0, 0.6, 0, 0.8, 0, 0};
  EXPECT_EQ(observability_of(study).weakest, "lever arm along forward together with boresight about right");
}

TEST(Observability, AdvisesForWhatIsFurthestFromItsGoal) {
  SImuOutput study = calibrated();
  study.sd_r_bs_b_m[2] = 5e-3;
  EXPECT_THAT(observability_of(study).advice, HasSubstr("rough"));
  study.sd_psi_rad[0] = 1.0 * kRadPerDeg;
  EXPECT_THAT(observability_of(study).advice, HasSubstr("figures of eight"));
  // Not observable comes before any ratio.
  study.t_d_observable = false;
  EXPECT_THAT(observability_of(study).advice, HasSubstr("slalom"));
}

TEST(ObservabilityWatch, SpeaksWhenSomethingChangesAndOnceAMinuteWhileSomethingIsMissing) {
  ObservabilityWatch watch;
  SImuOutput study = calibrated();
  study.status = CalibrationStatus::kCoarse;
  EXPECT_THAT(watch.update(study), IsEmpty());
  study.status = CalibrationStatus::kConverging;
  study.observable[2] = false;
  study.sd_psi_rad[2] = 2.0 * kRadPerDeg;
  study.weakest_direction = {0, 0, 1, 0, 0, 0};
  auto said = watch.update(study);
  ASSERT_FALSE(said.empty());
  EXPECT_THAT(said.back(), HasSubstr("not observable yet: boresight about down"));
  EXPECT_THAT(watch.update(study), IsEmpty());
  study.time += std::chrono::seconds{59};
  EXPECT_THAT(watch.update(study), IsEmpty());
  study.time += std::chrono::seconds{2};
  EXPECT_EQ(watch.update(study).size(), 1U);
  study.observable[2] = true;
  study.sd_psi_rad[2] = 0.5 * kRadPerDeg;
  said = watch.update(study);
  ASSERT_EQ(said.size(), 1U);
  EXPECT_THAT(said[0], HasSubstr("observable now: boresight about down (sd"));
  EXPECT_THAT(watch.update(study), IsEmpty());
}

}  // namespace
}  // namespace imuscope
