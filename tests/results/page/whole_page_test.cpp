// Drawings and parts of pages, whole.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <regex>

#include "results/page/agreement_chart.h"
#include "results/page/assets.h"
#include "results/page/html.h"
#include "results/page/mounting_drawing.h"
#include "results/page/printed_page.h"
#include "tests/support/file_content.h"
#include "tests/support/recorded_answer.h"
#include "tests/support/shared_data.h"

namespace imuscope::page {
namespace {

/// A line for each element.
std::string lines_of(const std::string& markup) {
  return std::regex_replace(markup, std::regex("><"), ">\n<") + '\n';
}

TEST(AgreementChart, IsDrawnToItsScales) {
  std::string text;
  const auto draw = [&](const std::string& title, const std::vector<AgreementSeries>& series) {
    text += title + '\n' + lines_of(agreement_chart(series, "seconds <s>").str());
  };
  draw("nothing", {});
  draw(
      "no point that can be drawn",
      {{"a", {{0.0, 1.0, 1.0, 1.0}, {1.0, 0.0, 0.0, 0.0}, {INFINITY, 1.0, 1.0, 1.0}, {1.0, NAN, 1.0, 1.0}}}});
  draw("one point", {{"a & b", {{10.0, 1.0, 0.9, 1.1}}}});
  draw("two series", {{"a", {{0.5, 1.2, 1.1, 1.3}, {20.0, 0.8, 0.7, 0.9}, {-1.0, 5.0, 5.0, 5.0}}},
                      {"b", {{300.0, 1.9, 0.0, 2.4}}}});
  draw("beyond", {{"a", {{1.0, 30.0, 20.0, 40.0}, {100.0, 0.01, 0.005, 0.02}}}});
  draw("low", {{"a", {{1.0, 0.3, 0.2, 0.4}}}});
  draw("seven series", std::vector<AgreementSeries>(7, {"s", {{4.0, 1.05, 1.0, 1.1}}}));
  for (const double ratio : {0.52, 0.66, 0.7, 1.3, 1.37, 1.8, 1.83, 4.5, 4.6, 9.0, 9.2})
    text += fmt::format("{}: {} lines\n", ratio, [&] {
      const std::string svg = agreement_chart({{"a", {{4.0, ratio, ratio, ratio}}}}, "x").str();
      return std::count(svg.begin(), svg.end(), 'H');
    }());
  test::expect_recorded("page/agreement_charts.txt", text);
}

DrawnImu turned(const std::string& name, double about_z, double about_x,
                const std::array<double, 3>& place_m) {
  const double c = std::cos(about_z);
  const double s = std::sin(about_z);
  const double cx = std::cos(about_x);
  const double sx = std::sin(about_x);
  return {name, {c, s * cx, s * sx, -s, c * cx, c * sx, 0.0, -sx, cx}, place_m};
}

TEST(MountingDrawing, IsDrawnInOneScaleWithNamesThatDoNotOverlap) {
  std::string text;
  const auto draw = [&](const std::string& title, const std::vector<DrawnImu>& imus) {
    text += title + '\n' + lines_of(mounting_drawing(imus).str());
  };
  draw("none", {});
  draw("at the reference", {turned("here", 0.0, 0.0, {0.0, 0.0, 0.0})});
  draw("three", {turned("left <1>", 0.3, 0.2, {0.4, -0.25, 0.1}),
                 turned("right", -1.2, 0.0, {-0.3, 0.35, -0.2}), turned("up", 2.0, 3.0, {0.02, 0.01, -0.6})});
  std::vector<DrawnImu> crowd;
  for (int i = 0; i < 9; ++i)
    crowd.push_back(
        turned(fmt::format("imu number {}", i), 0.7 * i, 0.3 * i, {0.01 * i, 0.02, 0.03 - 0.005 * i}));
  draw("a crowd", crowd);
  draw("far", {turned("a", 0.1, 0.1, {3.0, -2.0, 1.0}),
               turned("a name that is longer than the drawing is wide", 0.1, 0.1, {-3.0, 2.0, 1.0})});
  draw("an arrow towards the onlooker",
       {turned("a", 0.16, 0.0, {0.1, 0.1, 0.0}), turned("b", 0.15, 0.0, {-0.1, 0.1, 0.0}),
        turned("", 0.0, 1.42, {0.1, -0.1, 0.1})});
  test::expect_recorded("page/mounting_drawings.txt", text);
}

TEST(MountingDrawing, HasABarOfARoundLength) {
  std::string text;
  for (const double half_m : {0.01, 0.02, 0.021, 0.05, 0.083, 0.1, 0.17, 0.3, 0.45, 0.9, 1.7, 4.0, 9.0}) {
    const std::string svg = mounting_drawing({turned("a", 0.0, 0.0, {half_m, 0.0, 0.0})}).str();
    const std::size_t bar = svg.find("class=\"bar\"");
    text += fmt::format("{}: {}\n", half_m, svg.substr(bar, svg.find("</text>", bar) - bar));
  }
  test::expect_recorded("page/scale_bars.txt", text);
}

Html word(const char* words) { return page::text(words); }

TEST(Html, PartsAreAsTheyWere) {
  std::string all;
  const auto add = [&](const Html& html) { all += lines_of(html.str()); };
  add(page::text("a & b < c > d \" e ' f"));
  add(element("p", word("a"), ""));
  add(element("p", word("a"), "quiet"));
  add(paragraph("<a>", "quiet") + paragraph("b"));
  add(list_of({}, "c"));
  add(list_of({"a", "<b>"}, "c"));
  add(heading("id", "A & B") + link_to_heading("id", "A & B"));
  add(inline_svg("css", 12.5, 7.0, "it's \"it\"", "<path/>"));
  add(fold("none", {}));
  add(fold("a < b", word("x")));
  add(fold("a", word("x"), true));
  add(figure_place("a\"b", word("c"), "wide"));
  for (std::size_t columns : {1U, 4U, 5U, 6U, 7U}) {
    std::vector<Html> headings;
    std::vector<Html> cells;
    for (std::size_t i = 0; i < columns; ++i) {
      headings.push_back(i == 2 ? Html() : element("b", word("h")) + word("&"));
      cells.push_back(word("c"));
    }
    Table table(headings);
    all += fmt::format("{} ", table.empty());
    table.add_group(word("group"));
    table.add_row(cells);
    if (columns > 4) {
      cells.push_back(word("one more"));
      table.add_row(cells);
    }
    all += fmt::format("{}\n", table.empty());
    add(table.html());
  }
  add(svg_image("<svg>\"'<>&# %</svg>", "words & <more>"));
  all += json_for_script("{\"a\": \"</script><b>\"}") + '\n';
  test::expect_recorded("page/parts.txt", all);
}

TEST(Html, PagesAreTheirPartsAndTheirStyles) {
  std::string page = page_without_script("a <title>", word("body"));
  for (const std::string_view style : {kit_style(), document_style()}) {
    const std::size_t at = page.find(style);
    ASSERT_NE(at, std::string::npos);
    page.replace(at, style.size(), "STYLE\n");
  }
  std::string other =
      page_with_script("a <title>", word("body"), "p {}", "{\"a\": \"<b>\"}", "alert('Hello, world.');");
  const std::size_t at = other.find(kit_style());
  ASSERT_NE(at, std::string::npos);
  other.replace(at, kit_style().size(), "STYLE\n");
  test::expect_recorded("page/pages.txt", page + other);
}

/// What stands for the browser for a while, the only one that is found.
class Chromium {
 public:
  explicit Chromium(const std::string& script, const char* name = "chromium") : path_(std::getenv("PATH")) {
    const auto folder = test::scratch_folder() / "bin";
    std::filesystem::remove_all(folder);
    std::filesystem::create_directories(folder);
    std::ofstream(folder / name) << "#!/bin/sh\n" << script;
    std::filesystem::permissions(folder / name, std::filesystem::perms::owner_all);
    setenv("PATH", script.empty() ? "/nowhere" : folder.c_str(), 1);
  }
  ~Chromium() { setenv("PATH", path_.c_str(), 1); }
  Chromium(const Chromium&) = delete;
  Chromium& operator=(const Chromium&) = delete;

 private:
  std::string path_;
};

class PrintedPage : public testing::Test {
 protected:
  [[nodiscard]] Result<std::filesystem::path> print() const {
    return print_page(*OutputFolder::open(folder_), "a page.html");
  }
  std::filesystem::path folder_ = test::scratch_folder() / "out";
};

TEST_F(PrintedPage, IsWhatTheBrowserPrinted) {
  const Chromium chromium(
      "echo noise; echo noise >&2\nprintf '%s\\n' \"$@\" > \"" + folder_.string() +
      "/arguments\"\nfor a; do case \"$a\" in --print-to-pdf=*) echo '%PDF of it' > \"${a#*=}\";; esac; done\n");
  const auto printed = print();
  ASSERT_TRUE(printed) << printed.error().text();
  EXPECT_EQ(*printed, folder_ / "a page.pdf");
  EXPECT_EQ(test::content_of(*printed), "%PDF of it\n");
  std::string arguments = test::content_of(folder_ / "arguments");
  const std::regex scratch("[^=]*/imuscope-page-[^/]*/");
  EXPECT_TRUE(std::regex_search(arguments, scratch));
  std::smatch found;
  ASSERT_TRUE(std::regex_search(arguments, found, std::regex("--print-to-pdf=(.*)/page.pdf")));
  EXPECT_FALSE(std::filesystem::exists(found[1].str())) << "its folder is gone";
  EXPECT_EQ(std::regex_search(arguments, std::regex("--no-sandbox\n")), geteuid() == 0);
  EXPECT_NE(arguments.find("file://" + (folder_ / "a page.html").string() + "\n"), std::string::npos);
  EXPECT_NE(arguments.find("--headless\n"), std::string::npos);
}

TEST_F(PrintedPage, IsPrintedByTheBrowserWithoutWindowsWhereThatIsThere) {
  const Chromium chromium(
      "for a; do case \"$a\" in --print-to-pdf=*) echo '%PDF' > \"${a#*=}\";; esac; done\n",
      "chromium-headless-shell");
  const auto printed = print();
  ASSERT_TRUE(printed) << printed.error().text();
  EXPECT_EQ(test::content_of(*printed), "%PDF\n");
}

TEST_F(PrintedPage, IsNoneWhereTheBrowserPrintsNothingOrFailsOrIsNotThere) {
  {
    const Chromium chromium("exit 0\n");
    EXPECT_NE(print().error().text().find("did not print"), std::string::npos);
  }
  {
    const Chromium chromium(
        "for a; do case \"$a\" in --print-to-pdf=*) echo '%PDF' > \"${a#*=}\";; esac; done\nexit 3\n");
    EXPECT_NE(print().error().text().find("did not print"), std::string::npos);
  }
  {
    const Chromium chromium(
        "for a; do case \"$a\" in --print-to-pdf=*) echo ' %PDF' > \"${a#*=}\";; esac; done\n");
    EXPECT_NE(print().error().text().find("did not print"), std::string::npos);
  }
  const Chromium chromium("");
  EXPECT_NE(print().error().text().find("could not be started"), std::string::npos);
}

}  // namespace
}  // namespace imuscope::page
