/// Tasks are named by what they read, and by nothing else.

#include "fleet/plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "fleet/content_hash.h"
#include "made_campaign.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

using testing::HasSubstr;

fleet::Plan plan(const fleet::FleetFile& fleet, const std::string& program = kMadeProgram) {
  auto planned = fleet::plan_campaign(fleet, program);
  EXPECT_TRUE(planned) << planned.error().text();
  return *planned;
}

TEST(Plan, HasAStudyForEachCaptureAndATaskForEachUnit) {
  const auto fleet = make_fleet(scratch_folder(), 3, 2);
  const auto planned = plan(fleet);
  EXPECT_EQ(planned.studies.size(), 6U);
  EXPECT_EQ(planned.units.size(), 3U);
  EXPECT_EQ(planned.units.front().drives.size(), 2U);
  std::set<std::string> keys;
  for (const auto& task : planned.studies) keys.insert(task.key);
  EXPECT_EQ(keys.size(), 6U);
}

TEST(Plan, KeysFollowContentConfigurationAndProgramAndNotNamesOrTimes) {
  const auto folder = scratch_folder();
  auto fleet = make_fleet(folder, 1, 1);
  const auto capture = folder / "captures" / "v00" / "d00.lcm";
  const std::string key = plan(fleet).studies.front().key;
  std::filesystem::last_write_time(capture,
                                   std::filesystem::file_time_type::clock::now() + std::chrono::hours(1));
  EXPECT_EQ(plan(fleet).studies.front().key, key);
  EXPECT_NE(plan(fleet, "another program").studies.front().key, key);
  std::filesystem::rename(capture, folder / "captures" / "v00" / "renamed.lcm");
  EXPECT_EQ(plan(fleet).studies.front().key, key);
  write_file(folder / "captures" / "v00" / "renamed.lcm", "0 1");
  EXPECT_NE(plan(fleet).studies.front().key, key);
  write_file(folder / "captures" / "v00" / "renamed.lcm", "0 0");
  write_file(folder / "car.toml", "a");
  fleet.config = folder / "car.toml";
  const std::string with_config = plan(fleet).studies.front().key;
  EXPECT_NE(with_config, key);
  write_file(folder / "car.toml", "b");
  EXPECT_NE(plan(fleet).studies.front().key, with_config);
}

TEST(Plan, NamesTheCommandsAsAShellReadsThem) {
  const auto folder = scratch_folder() / "it's here";
  const auto fleet = make_fleet(folder, 1, 1);
  const auto line = fleet::shell_line(fleet::command_of(plan(fleet).studies.front()));
  EXPECT_THAT(line, HasSubstr("imuscope fleet study --out '"));
  EXPECT_THAT(line, HasSubstr("it'\\''s here"));
}

TEST(Plan, StudiesFilesThatGoOnAsOneCaptureAndCopiesOnce) {
  const auto folder = scratch_folder();
  const auto fleet = make_fleet(folder, 1, 1);
  const auto drive = folder / "captures" / "v00";
  const std::string key = plan(fleet).studies.front().key;
  write_file(drive / "d00_001.lcm", "goes on");
  write_file(drive / "copy.lcm", "0 0");
  write_file(folder / "captures" / "elsewhere.lcm", "of nobody");
  const auto planned = plan(fleet);
  ASSERT_EQ(planned.captures.size(), 3U);
  EXPECT_EQ(planned.studies.size(), 2U);
  for (const auto& capture : planned.captures) {
    if (capture.name == "v00/d00.lcm") {
      EXPECT_EQ(capture.files.size(), 2U);
      EXPECT_NE(capture.key, key);
    }
    if (capture.name == "elsewhere.lcm") {
      EXPECT_THAT(capture.not_studied, HasSubstr("no [[mounting]]"));
    }
  }
  write_file(drive / "copy_of_copy.lcm", "0 0");
  for (const auto& capture : plan(fleet).captures) {
    if (capture.name == "v00/copy_of_copy.lcm") {
      EXPECT_THAT(capture.not_studied, HasSubstr("content of v00/copy.lcm"));
    }
  }
}

TEST(ContentHash, IsThatOfTheStandard) {
  // FIPS 180-4, example "abc".
  EXPECT_EQ(fleet::sha256_of("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_NE(fleet::key_of({"ab", "c"}), fleet::key_of({"a", "bc"}));
}

}  // namespace
}  // namespace imuscope::test
