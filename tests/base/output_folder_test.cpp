#include "base/output_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>
#include <fstream>

#include "tests/support/file_content.h"
#include "tests/support/file_size_limit.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

namespace fs = std::filesystem;
using test::content_of;
using testing::HasSubstr;

class OutputFolderTest : public testing::Test {
 protected:
  OutputFolder opened() {
    auto folder = OutputFolder::open(out_);
    EXPECT_TRUE(folder) << folder.error().text();
    return *folder;
  }
  /// What is in the folder, by name.
  [[nodiscard]] std::vector<std::string> names() const {
    std::vector<std::string> found;
    for (const auto& entry : fs::directory_iterator(out_)) found.push_back(entry.path().filename().string());
    std::sort(found.begin(), found.end());
    return found;
  }

  fs::path scratch_ = test::scratch_folder();
  fs::path out_ = scratch_ / "a" / "out";
};

TEST_F(OutputFolderTest, WritesFilesAndLeavesNothingElse) {
  const auto folder = opened();
  ASSERT_TRUE(folder.write_whole("run.json", "{}"));
  auto rows = folder.begin("rows.csv");
  ASSERT_TRUE(rows);
  EXPECT_EQ(names(), (std::vector<std::string>{"rows.csv", "run.json"})) << "rows have their name at once";
  rows->write("a,b\n");
  ASSERT_TRUE(rows->close());
  ASSERT_TRUE(folder.write_whole("run.json", "{1}"));
  EXPECT_EQ(content_of(out_ / "run.json"), "{1}");
  EXPECT_EQ(content_of(out_ / "rows.csv"), "a,b\n");
  const auto scratch = folder.scratch_file();
  ASSERT_TRUE(scratch);
  EXPECT_EQ(::write(scratch->get(), "x", 1), 1);
  EXPECT_EQ(names(), (std::vector<std::string>{"rows.csv", "run.json"})) << "a scratch file has no name";
}

TEST_F(OutputFolderTest, FollowsNoLinkThatLiesInIt) {
  const auto folder = opened();
  const fs::path victim = scratch_ / "victim";
  std::ofstream(victim) << "precious";
  fs::create_directory(scratch_ / "elsewhere");
  for (const char* name : {"whole", "begun", "new"}) fs::create_symlink(victim, out_ / name);
  fs::create_hard_link(victim, out_ / "hard");
  fs::create_symlink(scratch_ / "elsewhere", out_ / "figures");

  ASSERT_TRUE(folder.write_whole("whole", "x"));
  ASSERT_TRUE(folder.write_whole("hard", "x"));
  auto begun = folder.begin("begun");
  ASSERT_TRUE(begun);
  begun->write("x");
  ASSERT_TRUE(begun->close());
  EXPECT_FALSE(folder.create_new("new").is_open());
  EXPECT_EQ(errno, EEXIST);
  EXPECT_EQ(content_of(victim), "precious");
  EXPECT_FALSE(fs::is_symlink(out_ / "whole"));
  EXPECT_EQ(content_of(out_ / "begun"), "x");

  const auto sub = folder.sub_folder("figures");
  ASSERT_FALSE(sub);
  EXPECT_THAT(sub.error().what, HasSubstr("is a link"));
  EXPECT_TRUE(fs::is_empty(scratch_ / "elsewhere"));
}

TEST_F(OutputFolderTest, StaysTheSameFolderWhenItsPathBecomesAnother) {
  const auto folder = opened();
  fs::rename(out_, scratch_ / "moved");
  fs::create_directory(scratch_ / "elsewhere");
  fs::create_symlink(scratch_ / "elsewhere", out_);
  ASSERT_TRUE(folder.write_whole("run.json", "{}"));
  EXPECT_TRUE(fs::is_empty(scratch_ / "elsewhere"));
  EXPECT_EQ(content_of(scratch_ / "moved" / "run.json"), "{}");
}

/// The disk is full and has room again: no line is torn, what is lost is counted, and the file goes on.
TEST_F(OutputFolderTest, AFileGoesOnWhereThereIsRoomAgain) {
  const auto folder = opened();
  auto rows = folder.begin("rows.csv");
  ASSERT_TRUE(rows);
  const std::string line = std::string(99, 'x') + "\n";
  const auto write_lines = [&](int n) {
    for (int i = 0; i < n; ++i) rows->write(line);
  };
  write_lines(100);
  EXPECT_FALSE(rows->problem());
  {
    // In the midst of a block, and of a line.
    const test::FileSizeLimit full(12'345);
    write_lines(100);
    ASSERT_TRUE(rows->problem());
    EXPECT_THAT(rows->problem()->text(), testing::AllOf(HasSubstr("rows.csv"), HasSubstr("lines are lost")));
    EXPECT_THAT(rows->problem()->remedy, HasSubstr("goes on by itself"));
  }
  write_lines(200);
  EXPECT_FALSE(rows->problem()) << "the disk has room";
  const auto closed = rows->close();
  ASSERT_FALSE(closed);
  const std::string content = content_of(out_ / "rows.csv");
  ASSERT_EQ(content.size() % line.size(), 0U) << "a line is torn";
  const std::size_t kept = content.size() / line.size();
  EXPECT_GT(kept, 200U);
  for (std::size_t i = 0; i < kept; ++i) ASSERT_EQ(content.substr(i * line.size(), line.size()), line);
  EXPECT_THAT(closed.error().what, HasSubstr(std::to_string(400 - kept) + " lines were lost"));
}

TEST_F(OutputFolderTest, AFileThatCannotBeWrittenIsToldAndWhatStoodThereStays) {
  const auto folder = opened();
  ASSERT_TRUE(folder.write_whole("run.json", "before"));
  auto rows = folder.begin("rows.csv");
  ASSERT_TRUE(rows);
  {
    const test::FileSizeLimit limit(4096);
    const std::string large(100'000, 'x');
    const auto written = folder.write_whole("run.json", large);
    ASSERT_FALSE(written);
    EXPECT_EQ(written.error().kind, ErrorKind::kWork);
    EXPECT_THAT(written.error().what, HasSubstr("run.json could not be written"));
    rows->write(large);
    const auto closed = rows->close();
    ASSERT_FALSE(closed);
    EXPECT_THAT(closed.error().what, HasSubstr("rows.csv is not whole"));
  }
  EXPECT_EQ(content_of(out_ / "run.json"), "before");
  EXPECT_EQ(names(), (std::vector<std::string>{"rows.csv", "run.json"}));

  fs::create_directory(out_ / "folder");
  std::ofstream(out_ / "folder" / "file") << "x";
  EXPECT_FALSE(folder.write_whole("folder", "x"));
  EXPECT_FALSE(folder.begin("folder"));
  EXPECT_EQ(names(), (std::vector<std::string>{"folder", "rows.csv", "run.json"}));
}

TEST_F(OutputFolderTest, TakesOverFromAScratchFolder) {
  const auto folder = opened();
  const auto scratch = folder.scratch_folder();
  ASSERT_TRUE(scratch);
  ASSERT_TRUE(scratch->write_whole("a.svg", "new"));
  fs::create_symlink(scratch_ / "victim", out_ / "a.svg");
  ASSERT_TRUE(folder.take(*scratch, "a.svg"));
  EXPECT_FALSE(folder.take(*scratch, "b.svg"));
  folder.remove(scratch->path().filename().string());
  EXPECT_EQ(names(), (std::vector<std::string>{"a.svg"}));
  EXPECT_FALSE(fs::exists(scratch_ / "victim"));
  EXPECT_EQ(content_of(out_ / "a.svg"), "new");
}

TEST(OutputFolder, WhereNoneCanBeMadeSaysWhy) {
  const fs::path file = test::scratch_folder() / "file";
  std::ofstream(file) << "x";
  const auto folder = OutputFolder::open(file / "below");
  ASSERT_FALSE(folder);
  EXPECT_THAT(folder.error().what, HasSubstr("cannot be made: Not a directory"));
}

}  // namespace
}  // namespace imuscope
