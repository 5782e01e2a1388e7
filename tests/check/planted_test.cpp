// Every kind of mistake in a made drive: all that the look at the data finds, word by word.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "made_drive.h"
#include "tests/support/recorded_answer.h"

namespace imuscope::check {
namespace {

std::string with_mistakes(const test::DriveInMemory& healthy, const std::string& only = {}) {
  std::string text = "healthy\n" + findings_text(look_at(healthy));
  for (const test::Mistake& mistake : test::planted_mistakes()) {
    if (mistake.name.find(only) == std::string::npos) continue;
    test::DriveInMemory drive = healthy;
    mistake.plant(drive);
    text += mistake.name + '\n' + findings_text(look_at(drive));
  }
  return text;
}

TEST(PlantedMistakes, AreAllFoundAsTheyOnceWere) {
  test::expect_recorded("check/planted.txt", with_mistakes(made_drive()), 1e-5);
}

// What shows only where a drive has straights, or is long.
TEST(PlantedMistakes, OfALongDriveWithStraightsAreFoundAsTheyOnceWere) {
  const test::DriveInMemory healthy =
      made_drive({.length_s = 300.0, .reference_hz = 40.0, .study_hz = 50.0, .straights = true});
  std::string text;
  for (const char* only : {"deg/s", "its clock", "its place", "without turns"})
    text += with_mistakes(healthy, only);
  test::expect_recorded("check/planted_on_straights.txt", text, 1e-5);
}

// Times in milliseconds have steps of seconds as they are read; that is no gap.
TEST(PlantedMistakes, AUnitThatWasPutRightIsNoSecondMistake) {
  for (const std::size_t device : {test::kReference, test::kStudy}) {
    test::DriveInMemory drive = made_drive();
    for (Sample& sample : drive.samples[device])
      sample.time = HostTime{} + from_seconds(1e3 * to_seconds(sample.time - HostTime{}));
    for (const Finding& finding : look_at(drive)) EXPECT_NE(finding.check, "missing samples");
  }
}

// At an even speed on a straight road no step is small, and none is a multiple of another.
TEST(PlantedMistakes, AnEvenSpeedMakesNoStepsOfDigits) {
  test::DriveInMemory drive = made_drive({.length_s = 60.0, .turns = 0.0});
  std::erase_if(drive.samples[test::kGnss],
                [](const Sample& sample) { return to_seconds(sample.time - HostTime{}) < 140.0; });
  for (const Finding& finding : look_at(drive)) EXPECT_NE(finding.check, "position steps");
}

// The S-IMU fits no reference that is left-handed, and has nothing to mend.
TEST(PlantedMistakes, ALeftHandedReferenceIsNotHeldAgainstTheSImu) {
  test::DriveInMemory drive = made_drive({.length_s = 100.0});
  for (Sample& sample : drive.samples[test::kReference]) {
    sample.imu.omega_radps[1] *= -1.0;
    sample.imu.f_mps2[1] *= -1.0;
  }
  const auto findings = look_at(drive);
  ASSERT_EQ(findings.size(), 1U) << findings_text(findings);
  EXPECT_EQ(findings[0].check, "handedness");
  EXPECT_EQ(findings[0].device, "reference");
}

}  // namespace
}  // namespace imuscope::check
