/// Two runs side by side.

#include <gmock/gmock.h>
#include <sys/wait.h>

#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>

#include "results/report/comparison_page.h"
#include "tests/results/report/synthetic_run.h"
#include "tests/support/file_content.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

using test::content_of;
using testing::HasSubstr;
using testing::Not;

/// Two folders of the same made-up drive; the second's lever arm is another by `shift_m`.
std::pair<std::filesystem::path, std::filesystem::path> two_runs(double shift_m,
                                                                 const test::SyntheticRun& of_second = {}) {
  const auto folder = test::scratch_folder();
  std::filesystem::create_directories(folder / "monday");
  std::filesystem::create_directories(folder / "friday");
  test::write_synthetic_run(folder / "monday", {});
  test::write_synthetic_run(folder / "friday", of_second);
  auto calibration = nlohmann::json::parse(content_of(folder / "friday" / "calibration.json"));
  for (auto& imu : calibration["imus"]) imu["r_bs_b_m"][0] = imu["r_bs_b_m"][0].get<double>() + shift_m;
  std::ofstream(folder / "friday" / "calibration.json") << calibration.dump();
  return {folder / "monday", folder / "friday"};
}

std::string page_of(const std::pair<std::filesystem::path, std::filesystem::path>& runs) {
  const auto page = comparison_page(runs.first, runs.second);
  EXPECT_TRUE(page) << page.error().text();
  return page ? *page : "";
}

/// Rows whose last cell is marked as more than chance.
std::size_t marked(const std::string& page) {
  static const std::regex kMarked("<td[^>]*><strong class=\"no\">[^/]*sd</span></strong></td></tr>");
  return static_cast<std::size_t>(
      std::distance(std::sregex_iterator(page.begin(), page.end(), kMarked), std::sregex_iterator()));
}

TEST(Comparison, TheSameMountingTwiceIsNotMarkedAndAShiftedOneIs) {
  EXPECT_EQ(marked(page_of(two_runs(0.0))), 0U);
  // 0.8 mm of sd in each run: 1.13 mm together. 5 mm are 4.4 of it, in both S-IMUs.
  const std::string page = page_of(two_runs(0.005));
  EXPECT_EQ(marked(page), 2U);
  EXPECT_THAT(page, HasSubstr("5.0 ± 1.1"));
  EXPECT_THAT(page, HasSubstr("4.4 sd"));
}

TEST(Comparison, AnSImuOfOneRunAloneIsNamed) {
  test::SyntheticRun second;
  second.names = {"mtx1", "left_rear"};
  const std::string page = page_of(two_runs(0.0, second));
  EXPECT_THAT(page, HasSubstr("mtx2 is in monday"));
  EXPECT_THAT(page, HasSubstr("left_rear is in friday"));
}

TEST(Comparison, ThePageRunsNoScriptAndLoadsNothing) {
  const std::string page = page_of(two_runs(0.0));
  EXPECT_THAT(page, Not(HasSubstr("<script")));
  EXPECT_THAT(page, HasSubstr("default-src 'none'"));
  EXPECT_FALSE(std::regex_search(page, std::regex("\\s(src|href)\\s*=")));
}

TEST(Comparison, AFolderThatIsNoRunIsOneSentence) {
  const auto runs = two_runs(0.0);
  const auto page = comparison_page(runs.first, runs.first.parent_path() / "nowhere");
  ASSERT_FALSE(page);
  EXPECT_THAT(page.error().text(), HasSubstr("nowhere is not a folder"));
}

TEST(Comparison, TheCommandWritesOverNothingUnlessAskedTo) {
  const auto runs = two_runs(0.0);
  const auto folder = runs.first.parent_path();
  const auto command = [&](const std::string& more) {
    const std::string line = "cd '" + folder.string() + "' && '" + test::program_path("imuscope").string() +
                             "' report monday friday " + more + " >out.txt 2>err.txt";
    const int status = std::system(line.c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  };
  std::ofstream(folder / "comparison.html") << "mine";
  EXPECT_EQ(command(""), 2);
  EXPECT_THAT(content_of(folder / "err.txt"), HasSubstr("comparison.html exists"));
  EXPECT_EQ(content_of(folder / "comparison.html"), "mine");
  EXPECT_EQ(command("--out other.html"), 0);
  EXPECT_THAT(content_of(folder / "other.html"), HasSubstr("monday"));
  EXPECT_EQ(command("--force"), 0);
  EXPECT_THAT(content_of(folder / "comparison.html"), HasSubstr("friday"));
}

}  // namespace
}  // namespace imuscope
