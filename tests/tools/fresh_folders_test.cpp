// tools/support/fresh_folders: what a tool left goes, what is anybody else's stays.

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <cstdlib>
#include <fstream>

#include "tests/support/file_content.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

namespace fs = std::filesystem;

class FreshFolders : public testing::Test {
 protected:
  void SetUp() override {
    // Outside of the checkout's own build, where folders have to have a mark.
    std::string name = testing::TempDir() + "imuscope_fresh_XXXXXX";
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override { fs::remove_all(folder_); }

  /// The exit code; what was said goes to said_.
  int make(const std::string& folders) {
    const fs::path said = scratch_folder() / "said";
    const std::string command = "cd '" + folder_.string() + "' && '" +
                                source_path("tools/support/fresh_folders").string() + "' soak " + folders +
                                " 2>'" + said.string() + "'";
    const int status = std::system(command.c_str());
    said_ = content_of(said);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  void put(const std::string& name) const {
    fs::create_directories((folder_ / name).parent_path());
    std::ofstream(folder_ / name) << "mine";
  }

  fs::path folder_;
  std::string said_;
};

TEST_F(FreshFolders, AFolderIsMadeAndTheNextRunEmptiesItOfWhatTheLastOneLeft) {
  ASSERT_EQ(make("a/new"), 0) << said_;
  put("a/new/run/capture.lcm");
  put("a/new/.hidden");
  put("a/beside");
  ASSERT_EQ(make("a/new"), 0) << said_;
  EXPECT_FALSE(fs::exists(folder_ / "a/new/run"));
  EXPECT_FALSE(fs::exists(folder_ / "a/new/.hidden"));
  EXPECT_TRUE(fs::exists(folder_ / "a/beside"));
}

TEST_F(FreshFolders, AnEmptyFolderIsTaken) {
  fs::create_directories(folder_ / "empty");
  EXPECT_EQ(make("empty"), 0) << said_;
}

TEST_F(FreshFolders, NothingIsTakenFromAFolderThatHoldsWhatIsSomebodysNorFromThoseNamedWithIt) {
  ASSERT_EQ(make("left"), 0) << said_;
  put("left/old");
  put("home/thesis.tex");
  EXPECT_EQ(make("left home"), 2);
  EXPECT_NE(said_.find("soak: home holds what no tool of imuscope left there, such as thesis.tex; choose"),
            std::string::npos)
      << said_;
  EXPECT_TRUE(fs::exists(folder_ / "home/thesis.tex"));
  EXPECT_TRUE(fs::exists(folder_ / "left/old"));
}

TEST_F(FreshFolders, ALinkIsFollowedAndAFileIsNoFolder) {
  put("home/thesis.tex");
  fs::create_directory_symlink("home", folder_ / "link");
  EXPECT_EQ(make("link"), 2);
  EXPECT_TRUE(fs::exists(folder_ / "home/thesis.tex"));
  EXPECT_EQ(make("home/thesis.tex"), 2);
  EXPECT_NE(said_.find("is no folder"), std::string::npos) << said_;
}

}  // namespace
}  // namespace imuscope::test
