/// A receiver whose positions contradict the motion: the study says so before anything else.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <fstream>

#include "programs.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

nlohmann::json run_with(const std::string& name, const std::string& faults) {
  const auto folder = scratch_folder() / name;
  std::filesystem::create_directories(folder);
  std::vector<std::string> record{"record",    source_path("config/demo.toml").string(),
                                  "--minutes", "4",
                                  "--seed",    "1",
                                  "--out",     (folder / "drive").string()};
  if (!faults.empty()) {
    std::ofstream(folder / "faults.toml") << faults;
    record.insert(record.end(), {"--faults", (folder / "faults.toml").string()});
  }
  EXPECT_EQ(run_program("imusim", record, folder / "imusim.log"), 0) << read_text(folder / "imusim.log");
  EXPECT_EQ(run_program("imuscope",
                        {"replay", (folder / "drive" / "capture.lcm").string(), "--config",
                         (folder / "drive" / "config.toml").string(), "--out", (folder / "run").string()},
                        folder / "imuscope.log"),
            0)
      << read_text(folder / "imuscope.log");
  return read_json(folder / "run" / "run.json");
}

using Texts = std::vector<std::string>;

TEST(RefusedGnss, IsWhatAStudySaysFirst) {
  // 60 s of 240 are 30 m off, at velocities that are right.
  const auto run = run_with("jump",
                            "[[fault]]\ndevice = \"gnss\"\nkind = \"rtk_jump\"\nat_s = 130.0\n"
                            "for_s = 60.0\nby_n_m = [30.0, 0.0, 0.0]\n");
  EXPECT_TRUE(run.at("gnss").at("contradicts_motion").get<bool>());
  const auto warnings = run.at("warnings").get<Texts>();
  ASSERT_FALSE(warnings.empty());
  EXPECT_THAT(warnings.front(), testing::HasSubstr("positions were refused"));
  EXPECT_THAT(warnings.front(), testing::HasSubstr("GPS time is 18 s ahead of UTC"));
}

TEST(RefusedGnss, IsNoWordWhereTheReceiverIsRight) {
  const auto run = run_with("right", "");
  EXPECT_FALSE(run.at("gnss").at("contradicts_motion").get<bool>());
  EXPECT_GT(run.at("gnss").at("used").get<int>(), 2000);
  EXPECT_THAT(run.at("warnings").get<Texts>(),
              testing::Not(testing::Contains(testing::HasSubstr("refused"))));
}

}  // namespace
}  // namespace imuscope::test
