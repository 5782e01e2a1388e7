/// fleet.toml as people write it, and as they mistype it.

#include "fleet/fleet_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "made_campaign.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

using testing::HasSubstr;

Result<fleet::FleetFile> read(const std::string& toml) {
  const auto file = scratch_folder() / "fleet.toml";
  write_file(file, toml);
  return fleet::read_fleet_file(file);
}

TEST(FleetFile, SaysWhichUnitWasMountedInWhichCapture) {
  const auto fleet = read(R"([fleet]
name = "lot 7"
captures = ["drives"]
[tasks]
attempts = 2
memory_mb = 900
timeout_min = 2
[[mounting]]
vehicle = "van"
name = "winter"
captures = ["van/2026-01*", "van/2026-02*"]
units = { mtx1 = "A1", mtx2 = "A2" }
[[mounting]]
vehicle = "van"
name = "spring"
captures = ["van/*"]
units = { mtx1 = "A2" }
[[unit]]
serial = "A1"
certificate = "certificates/a1.json"
)");
  ASSERT_TRUE(fleet) << fleet.error().text();
  EXPECT_EQ(fleet->name, "lot 7");
  EXPECT_EQ(fleet->limits.attempts, 2);
  EXPECT_DOUBLE_EQ(fleet->limits.timeout_s, 120.0);
  EXPECT_EQ(fleet->out.filename(), "campaign");
  EXPECT_EQ(fleet::mounting_of(*fleet, "van/2026-02-03/capture.lcm"), 0U);
  EXPECT_EQ(fleet::mounting_of(*fleet, "van/2026-03-03/capture.lcm"), 1U);
  EXPECT_FALSE(fleet::mounting_of(*fleet, "bus/capture.lcm"));
  EXPECT_EQ(fleet::unit_of(fleet->mountings[0], "mtx2"), "A2");
  EXPECT_EQ(fleet::unit_of(fleet->mountings[1], "mtx2"), "van/mtx2");
  EXPECT_TRUE(fleet->certificates.at("A1").is_absolute());
}

TEST(FleetFile, WithoutMountingsIsOneVehicle) {
  const auto fleet = read("[fleet]\ncaptures = [\"drives\"]\n");
  ASSERT_TRUE(fleet) << fleet.error().text();
  EXPECT_EQ(fleet->mountings.size(), 1U);
  EXPECT_EQ(fleet::mounting_of(*fleet, "any/capture.lcm"), 0U);
}

TEST(FleetFile, RefusesWhatItDoesNotKnowWithTheLine) {
  const std::vector<std::pair<std::string, std::string>> wrong{
      {"", "captures"},
      {"[fleet]\ncaptures = []\n", "empty"},
      {"[fleet]\ncapture = [\"a\"]\n", "capture"},
      {"[fleet]\ncaptures = [\"a\"]\n[tasks]\nattempts = 0\n", ":4"},
      {"[fleet]\ncaptures = [\"a\"]\n[[mounting]]\nname = \"x\"\n", "vehicle"},
      {"[fleet]\ncaptures = [\"a\"]\nmounting = 3\n", "mounting"},
      {"[fleet\n", "not TOML"},
  };
  for (const auto& [toml, words] : wrong) {
    const auto fleet = read(toml);
    ASSERT_FALSE(fleet) << toml;
    EXPECT_EQ(fleet.error().kind, ErrorKind::kUsage) << toml;
    EXPECT_THAT(fleet.error().text(), HasSubstr(words)) << toml;
  }
}

}  // namespace
}  // namespace imuscope::test
