#include "study/regime_study.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace imuscope {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

HostTime drive_time(double s) { return HostTime{} + from_seconds(100.0 + s); }

/// A run of 60 s with a yaw rate of the given size between begin and end.
MotionWatch run_with(double size_radps, double begin_s, double end_s, bool with_speed) {
  MotionWatch watch;
  for (int k = 0; k < 6000; ++k) {
    const double t_s = k / 100.0;
    const bool moves = t_s >= begin_s && t_s < end_s;
    SImuEpoch epoch{};
    epoch.time = drive_time(t_s);
    epoch.omega_ib_b_radps = {0.0, 0.0, moves ? size_radps * std::sin(2.0 * t_s) : 0.0};
    epoch.f_b_mps2 = {moves ? std::sin(1.3 * t_s) : 0.0, 0.0, -9.81};
    watch.add(epoch, {});
    if (with_speed && k % 10 == 0) {
      Snapshot snapshot{};
      snapshot.navigation.status = NavigationStatus::kNavigating;
      snapshot.navigation.time = epoch.time;
      snapshot.navigation.v_n_mps = {moves ? 5.0 : 0.0, 0.0, 0.0};
      snapshot.navigation.sd_velocity_mps = {0.01, 0.01, 0.01};
      watch.add(snapshot);
    }
  }
  return watch;
}

TEST(RegimeStudy, ADriveWithItsStandstillHasBothAndNoRemark) {
  const auto regimes = find_regimes({}, run_with(0.3, 20.0, 45.0, true), {}, {}, drive_time(0.0));
  ASSERT_TRUE(regimes) << regimes.error().text();
  EXPECT_THAT(regimes->remarks, IsEmpty());
  const auto document = regimes_json(*regimes, drive_time(0.0));
  EXPECT_EQ(document.at("by"), "motion");
  ASSERT_EQ(document.at("regimes").size(), 2u);
  EXPECT_EQ(document.at("regimes")[1].at("name"), "dynamic");
  EXPECT_NEAR(document.at("regimes")[1].at("total_s").get<double>(), 25.0, 6.5);
  EXPECT_NEAR(document.at("regimes")[1].at("stretches")[0].at("begin_s").get<double>(), 20.0, 3.2);
}

TEST(RegimeStudy, AMissingPartIsSaid) {
  const auto always = find_regimes({}, run_with(0.3, 0.0, 60.0, true), {}, {}, drive_time(0.0));
  ASSERT_TRUE(always);
  EXPECT_THAT(always->remarks,
              ElementsAre(HasSubstr("there is no static part: the vehicle never stood for 1 s")));
  const auto never = find_regimes({}, run_with(0.3, 0.0, 0.0, true), {}, {}, drive_time(0.0));
  ASSERT_TRUE(never);
  EXPECT_THAT(never->remarks,
              ElementsAre(HasSubstr("there is no dynamic part: the vehicle stood all the time")));
  const auto blind = find_regimes({}, run_with(0.3, 20.0, 45.0, false), {}, {}, drive_time(0.0));
  ASSERT_TRUE(blind);
  EXPECT_THAT(blind->remarks, ElementsAre(HasSubstr("no speed was known")));
}

TEST(RegimeStudy, LabelsOfAPersonComeFromTheFileOrFromTheRecordedMessages) {
  const auto watch = run_with(0.3, 20.0, 45.0, true);
  const auto of_file =
      find_regimes({}, watch, {{5.0, 15.0, "yard"}, {20.0, 40.0, "gravel"}}, {}, drive_time(0.0));
  ASSERT_TRUE(of_file);
  EXPECT_EQ(of_file->by, RegimesBy::kLabels);
  EXPECT_THAT(of_file->chosen.names(), ElementsAre("yard", "gravel"));
  EXPECT_NEAR(of_file->motion.total_s(1), 25.0, 6.5) << "static and dynamic are known all the same";

  RegimeOptions options;
  options.by = RegimesBy::kLabels;
  const auto of_events = find_regimes(
      options, watch, {}, {{drive_time(10.0), "regime idle"}, {drive_time(30.0), "a bump"}}, drive_time(0.0));
  ASSERT_TRUE(of_events);
  ASSERT_EQ(of_events->chosen.stretches().size(), 1u);
  EXPECT_NEAR(of_events->chosen.total_s(0), 50.0, 0.21) << "until the end of the run";

  std::vector<MarkedMoment> many;
  for (int i = 0; i < 70; ++i) many.push_back({drive_time(0.5 * i), fmt::format("regime {}", i)});
  many.push_back({drive_time(40.0), "regime 0"});
  const auto first_ones = find_regimes(options, watch, {}, many, drive_time(0.0));
  ASSERT_TRUE(first_ones) << "whoever sends many names ends no study";
  EXPECT_EQ(first_ones->chosen.names().size(), 64U);
  EXPECT_EQ(first_ones->chosen.names().back(), "63");
  EXPECT_NEAR(first_ones->chosen.total_s(0), 0.5 + 20.0, 0.21);
  EXPECT_THAT(first_ones->remarks, ElementsAre(HasSubstr("what the last 6 names hold for")));

  const auto none = find_regimes(options, watch, {}, {{drive_time(30.0), "a bump"}}, drive_time(0.0));
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().kind, ErrorKind::kUsage);
  EXPECT_THAT(none.error().text(), HasSubstr("give --labels FILE.csv"));
}

}  // namespace
}  // namespace imuscope
