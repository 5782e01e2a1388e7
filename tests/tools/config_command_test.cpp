/// `imuscope config`: the reference in docs/ is what it prints, and every configuration that comes with the
/// project is good.

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "programs.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

TEST(ConfigCommand, DocumentIsWhatItPrints) {
  const auto printed = scratch_folder() / "configuration.md";
  ASSERT_EQ(run_program("imuscope", {"config"}, printed), 0);
  EXPECT_EQ(read_text(printed), read_text(source_path("docs/configuration.md")))
      << "make it anew: imuscope config > docs/configuration.md";
}

TEST(ConfigCommand, EveryConfigurationOfTheProjectIsGood) {
  std::size_t count = 0;
  for (const char* where : {"config", "docs/examples"}) {
    for (const auto& entry : std::filesystem::directory_iterator(source_path(where))) {
      // A script of faults is for imusim alone.
      if (entry.path().extension() != ".toml" || entry.path().stem() == "faults") continue;
      const auto log = scratch_folder() / "log";
      EXPECT_EQ(run_program("imuscope", {"config", entry.path().string()}, log), 0) << read_text(log);
      ++count;
    }
  }
  EXPECT_GT(count, 2U);
}

TEST(ConfigCommand, TheExampleOfTheCsvPageIsTheFileBesideIt) {
  const std::string page = read_text(source_path("docs/csv.md"));
  const auto begin = page.find("```toml\n") + std::string("```toml\n").size();
  EXPECT_EQ(page.substr(begin, page.find("```", begin) - begin),
            read_text(source_path("docs/examples/my_drive.toml")));
}

TEST(ConfigCommand, WrongKeyIsToldWithItsLine) {
  const auto folder = scratch_folder();
  const auto file = folder / "wrong.toml";
  std::ofstream(file) << "[noise]\nmodle = \"WN\"\n";
  const auto log = folder / "log";
  EXPECT_EQ(run_program("imuscope", {"config", file.string()}, log), 2);
  EXPECT_NE(read_text(log).find("wrong.toml:2: unknown key 'noise.modle'"), std::string::npos)
      << read_text(log);
}

}  // namespace
}  // namespace imuscope::test
