#include "service/run/new_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <fstream>
#include <set>
#include <thread>

#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

using testing::HasSubstr;
using testing::MatchesRegex;

const auto kNow = std::chrono::system_clock::time_point(std::chrono::seconds(1'700'000'000));

TEST(NewFolder, IsNamedByRunAndTime) {
  const auto folder = make_new_folder(test::scratch_folder() / "deep" / "runs", "a car", kNow);
  ASSERT_TRUE(folder) << folder.error().text();
  EXPECT_THAT(folder->filename().string(), MatchesRegex("a car-2023111[45]-[0-9]{6}"));
  EXPECT_TRUE(std::filesystem::is_directory(*folder));
}

TEST(NewFolder, TheSameSecondGivesAnotherNameEachTime) {
  const auto parent = test::scratch_folder();
  const auto first = make_new_folder(parent, "car", kNow);
  const auto second = make_new_folder(parent, "car", kNow);
  ASSERT_TRUE(first && second);
  EXPECT_EQ(second->string(), first->string() + "-2");
  std::ofstream(first->string() + "-3") << "a file";
  std::filesystem::create_symlink("nowhere", first->string() + "-4");
  const auto third = make_new_folder(parent, "car", kNow);
  ASSERT_TRUE(third) << third.error().text();
  EXPECT_EQ(third->string(), first->string() + "-5");
}

TEST(NewFolder, ThoseThatStartAtOnceGetOneEach) {
  const auto parent = test::scratch_folder();
  std::array<std::vector<std::string>, 4> made;
  {
    std::vector<std::jthread> threads;
    for (auto& own : made) {
      threads.emplace_back([&own, &parent] {
        for (int i = 0; i < 50; ++i) own.push_back(make_new_folder(parent, "car", kNow).value().string());
      });
    }
  }
  std::set<std::string> all;
  for (const auto& own : made) all.insert(own.begin(), own.end());
  EXPECT_EQ(all.size(), 200U);
}

TEST(NewFolder, ANameThatLeadsElsewhereIsRefused) {
  const auto parent = test::scratch_folder() / "runs";
  for (const std::string name :
       {"../../x", "/etc/x", "a/b", "", ".", "..", "a\nMAINPID=1", "\033[2J", "\xff"}) {
    const auto folder = make_new_folder(parent, name, kNow);
    ASSERT_FALSE(folder) << name;
    EXPECT_EQ(folder.error().kind, ErrorKind::kUsage);
    EXPECT_THAT(folder.error().text(), HasSubstr("cannot name a folder"));
  }
  EXPECT_FALSE(make_new_folder(parent, std::string(101, 'x'), kNow));
  EXPECT_FALSE(std::filesystem::exists(parent));
}

TEST(NewFolder, WhereItCannotBeMadeIsSaid) {
  const auto file = test::scratch_folder() / "file";
  std::ofstream(file) << "no folder";
  const auto folder = make_new_folder(file, "car", kNow);
  ASSERT_FALSE(folder);
  EXPECT_EQ(folder.error().kind, ErrorKind::kWork);
  EXPECT_THAT(folder.error().text(), HasSubstr("cannot be made"));
}

}  // namespace
}  // namespace imuscope
