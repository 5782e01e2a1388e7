/// A study gives the same files, to the byte, however many threads make it.

#include <gtest/gtest.h>

#include <set>
#include <string>

#include "programs.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

TEST(Threads, AStudyIsTheSameWithOneTwoAndEight) {
  const auto folder = scratch_folder();
  const auto log = folder / "log";
  ASSERT_EQ(run_program("imusim",
                        {"record", source_path("config/demo.toml").string(), "--minutes", "4", "--seed", "11",
                         "--out", (folder / "drive").string()},
                        log),
            0)
      << read_text(log);
  // Folders of one name, which the report says.
  const auto study_with = [&](const std::string& threads) {
    const auto out = folder / threads / "run";
    std::filesystem::create_directories(out.parent_path());
    EXPECT_EQ(run_program("imuscope",
                          {"process", (folder / "drive" / "capture.lcm").string(), "--out", out.string(),
                           "--threads", threads},
                          log),
              0)
        << read_text(log);
    return out;
  };
  const auto one = study_with("1");
  std::size_t compared = 0;
  for (const char* threads : {"2", "8"}) {
    const auto other = study_with(threads);
    for (const auto& entry : std::filesystem::directory_iterator(one)) {
      const auto name = entry.path().filename();
      EXPECT_EQ(read_text(entry.path()), read_text(other / name))
          << name << " with " << threads << " threads";
      ++compared;
    }
  }
  EXPECT_GT(compared, 2U * 15U);
}

}  // namespace
}  // namespace imuscope::test
