/// The catalogue and the page from results that were made.

#include "fleet/catalogue.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <random>

#include "fleet/database.h"
#include "fleet/fleet_page.h"
#include "fleet/unit_task.h"
#include "made_campaign.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

using testing::HasSubstr;
using testing::Not;

constexpr int kUnits = 8;
constexpr int kDrives = 6;

std::string content(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

class Catalogue : public testing::Test {
 protected:
  Catalogue()
      : fleet_(make_fleet(scratch_folder(), kUnits, kDrives)),
        plan_(*fleet::plan_campaign(fleet_, kMadeProgram)) {
    std::mt19937_64 random(3);
    std::normal_distribution<double> normal;
    int place = 0;
    for (const auto& task : plan_.studies) {
      const int unit = place / kDrives;
      const int drive = place % kDrives;
      ++place;
      publish(task, made_result(task, 10 * drive, [&](const std::string& quantity) {
                const double more = quantity == "angle random walk" && unit == 3 ? 1.2 : 0.0;
                return more + 0.07 * normal(random) + 0.03 * unit / kUnits;
              }));
    }
  }
  void reduce() {
    for (const auto& task : plan_.units) ASSERT_TRUE(fleet::do_unit(task, kMadeProgram));
    const auto written = fleet::write_catalogue(fleet_, plan_);
    ASSERT_TRUE(written) << written.error().text();
  }
  [[nodiscard]] std::filesystem::path file() const { return fleet_.out / fleet::kCatalogue; }
  [[nodiscard]] std::vector<std::string> ask(const std::string& sql) const {
    const auto database = fleet::Database::open_to_read(file());
    EXPECT_TRUE(database);
    auto rows = database->prepare(sql);
    EXPECT_TRUE(rows) << rows.error().text();
    std::vector<std::string> out;
    while (rows && *rows->next()) out.push_back(rows->text(0));
    return out;
  }

  [[nodiscard]] bool can_ask(const std::string& sql) const {
    const auto database = fleet::Database::open_to_read(file());
    auto rows = database->prepare(sql);
    return rows && rows->next();
  }

  fleet::FleetFile fleet_;
  fleet::Plan plan_;
};

TEST_F(Catalogue, HoldsEveryDriveAndFindsThePlantedUnit) {
  reduce();
  EXPECT_EQ(ask("SELECT count(*) FROM drives"), std::vector<std::string>{std::to_string(kUnits * kDrives)});
  EXPECT_EQ(ask("SELECT DISTINCT unit FROM outliers WHERE kind = 'unit'"),
            std::vector<std::string>{"unit03"});
  EXPECT_EQ(ask("SELECT DISTINCT unit FROM not_holding"), std::vector<std::string>{"unit03"});
  EXPECT_THAT(ask("SELECT captures FROM progress WHERE state = 'studied'"), testing::ElementsAre("48"));
  EXPECT_THAT(ask("SELECT drives FROM unit_results WHERE unit = 'unit00' LIMIT 1"),
              testing::ElementsAre("6"));
  // Every view can be asked.
  for (const auto& view : ask("SELECT name FROM sqlite_master WHERE type = 'view'"))
    EXPECT_TRUE(can_ask("SELECT * FROM " + view)) << view;
}

TEST_F(Catalogue, OfTheSameResultsIsTheSameToTheByte) {
  reduce();
  const auto first = fleet_.out / "first";
  ASSERT_TRUE(fleet::export_csv(file(), first));
  reduce();
  const auto second = fleet_.out / "second";
  ASSERT_TRUE(fleet::export_csv(file(), second));
  std::size_t n = 0;
  for (const auto& entry : std::filesystem::directory_iterator(first)) {
    EXPECT_EQ(content(entry.path()), content(second / entry.path().filename())) << entry.path();
    ++n;
  }
  EXPECT_EQ(n, 22U);
}

TEST_F(Catalogue, TellsWhatHasNoStudyAndWhatAnotherProgramLeft) {
  auto refused = made_result(plan_.studies[0], 1, [](const std::string&) { return 0.0; });
  refused["state"] = "refused";
  refused["reason"] = "no reference";
  refused.erase("summary");
  publish(plan_.studies[0], refused);
  std::filesystem::remove_all(fleet_.out / "studies" / plan_.studies[1].key);
  auto of_before = plan_.studies[1];
  of_before.key = "0123456789abcdef01234567";
  publish(of_before, refused);
  reduce();
  EXPECT_THAT(ask("SELECT capture || ': ' || state || ' ' || reason FROM without_study"),
              testing::ElementsAre("v00/d00.lcm: refused no reference", "v00/d01.lcm: not yet "));
  EXPECT_THAT(ask("SELECT key FROM other_results"), testing::ElementsAre(of_before.key));
  EXPECT_THAT(ask("SELECT drives FROM unit_results WHERE unit = 'unit00' LIMIT 1"),
              testing::ElementsAre("4"));
}

TEST_F(Catalogue, CannotBeChangedByAQuestion) {
  reduce();
  const auto before = content(file());
  const auto database = fleet::Database::open_to_read(file());
  for (const char* sql : {"DELETE FROM captures", "DROP TABLE captures", "ATTACH '/tmp/other.db' AS other",
                          "PRAGMA query_only = OFF", "VACUUM INTO '/tmp/other.db'"}) {
    auto statement = database->prepare(sql);
    if (statement) (void)statement->next();
  }
  auto statement = database->prepare("DELETE FROM captures");
  const bool refused = !statement || !statement->next();
  EXPECT_TRUE(refused);
  EXPECT_FALSE(database->prepare("SELECT 1; DELETE FROM captures"));
  EXPECT_EQ(content(file()), before);
  EXPECT_FALSE(std::filesystem::exists("/tmp/other.db"));
}

TEST_F(Catalogue, IsAPageOnWhichNothingFromOutsideIsMarkup) {
  const std::string evil = "<img src=x onerror=alert(1)></script><script>alert(2)</script>";
  fleet_.mountings[0].vehicle = evil;
  auto result = made_result(plan_.studies[0], 1, [](const std::string&) { return 0.0; });
  result["state"] = "refused";
  result["reason"] = evil;
  result.erase("summary");
  publish(plan_.studies[0], result);
  reduce();
  const auto page = fleet::write_fleet_page(fleet_.out, evil);
  ASSERT_TRUE(page) << page.error().text();
  const std::string html = content(*page);
  EXPECT_THAT(html, Not(HasSubstr("<img")));
  EXPECT_THAT(html, Not(HasSubstr("<script>alert")));
  EXPECT_THAT(html, HasSubstr("47 of 48 captures studied"));
  EXPECT_THAT(html, HasSubstr("1 unit stands out"));
  EXPECT_THAT(html, HasSubstr("unit03"));
  EXPECT_THAT(html, Not(HasSubstr("http://")));
}

TEST_F(Catalogue, ThatIsNoneIsRefusedInWords) {
  EXPECT_FALSE(fleet::write_fleet_page(scratch_folder(), "none"));
  const auto folder = scratch_folder();
  write_file(folder / fleet::kCatalogue, "no database");
  const auto page = fleet::write_fleet_page(folder, "none");
  ASSERT_FALSE(page);
  EXPECT_THAT(page.error().text(), HasSubstr("catalogue"));
}

}  // namespace
}  // namespace imuscope::test
