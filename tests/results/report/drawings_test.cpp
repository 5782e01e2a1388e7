/// Drawings of the first screen: where things stand in them, by numbers read back from the markup.

#include <gmock/gmock.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>

#include "base/grouped.h"
#include "results/report/data_sheet_table.h"
#include "results/report/mounting.h"
#include "results/report/page_parts.h"
#include "tests/results/report/synthetic_run.h"
#include "tests/support/shared_data.h"

namespace imuscope::report {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

struct At {
  double x = 0.0;
  double y = 0.0;
};

/// The numbers of every match of `pattern`, which has two groups.
std::vector<At> all_at(const std::string& svg, const std::string& pattern) {
  std::vector<At> out;
  const std::regex regex(pattern);
  for (std::sregex_iterator found(svg.begin(), svg.end(), regex), end; found != end; ++found)
    out.push_back({std::stod((*found)[1]), std::stod((*found)[2])});
  return out;
}

constexpr Rotation kAsB{1, 0, 0, 0, 1, 0, 0, 0, 1};
constexpr Rotation kUpsideDown{1, 0, 0, 0, -1, 0, 0, 0, -1};
constexpr double kMiddle = 110.0;

TEST(MountingDrawing, PlacesAreForwardUpRightRightAndDownDown) {
  const auto sensors = all_at(mounting_drawing({{"a", kAsB, {0.3, 0.1, -0.2}}}).str(),
                              "class=\"imu\" cx=\"([0-9.]+)\" cy=\"([0-9.]+)\"");
  ASSERT_EQ(sensors.size(), 3U);
  // From above: forward is up, right is right; three times as far forward as right.
  EXPECT_LT(sensors[0].y, kMiddle);
  EXPECT_GT(sensors[0].x, kMiddle);
  EXPECT_NEAR((kMiddle - sensors[0].y) / (sensors[0].x - kMiddle), 3.0, 0.02);
  // From the right: forward is right, what is above is up.
  EXPECT_GT(sensors[1].x, kMiddle);
  EXPECT_LT(sensors[1].y, kMiddle);
  EXPECT_NEAR((sensors[1].x - kMiddle) / (kMiddle - sensors[1].y), 1.5, 0.02);
  // From behind: right is right.
  EXPECT_GT(sensors[2].x, kMiddle);
  EXPECT_NEAR((kMiddle - sensors[2].y) / (sensors[2].x - kMiddle), 2.0, 0.02);
}

TEST(MountingDrawing, ASensorUpsideDownHasItsZAxisUp) {
  const auto z_axes = [](const Rotation& C_b_s) {
    const std::string svg = mounting_drawing({{"a", C_b_s, {0.1, 0.0, 0.0}}}).str();
    const auto from = all_at(svg, "class=\"axis-z\" d=\"M([0-9.]+) ([0-9.]+)L");
    const auto to = all_at(svg, "class=\"axis-z\" d=\"M[0-9.]+ [0-9.]+L([0-9.]+) ([0-9.]+)\"");
    EXPECT_EQ(from.size(), 2U) << "it points at the onlooker from above and is drawn in the other two";
    return to.front().y - from.front().y;
  };
  EXPECT_GT(z_axes(kAsB), 20.0);
  EXPECT_LT(z_axes(kUpsideDown), -20.0);
}

TEST(MountingDrawing, NamesOfSensorsCloseToEachOtherDoNotLieUponEachOther) {
  const auto names = all_at(mounting_drawing({{"front", kAsB, {0.010, 0.0, 0.0}},
                                              {"middle", kAsB, {0.012, 0.0, 0.0}},
                                              {"rear", kAsB, {0.014, 0.0, 0.0}}})
                                .str(),
                            "class=\"name\" text-anchor=\"middle\" x=\"([0-9.]+)\" y=\"([0-9.]+)\"");
  ASSERT_EQ(names.size(), 9U);
  for (std::size_t view = 0; view < 3; ++view) {
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = i + 1; j < 3; ++j) {
        const At a = names[3 * view + i];
        const At b = names[3 * view + j];
        EXPECT_TRUE(std::abs(a.x - b.x) > 24.0 || std::abs(a.y - b.y) >= 11.0) << view << i << j;
      }
    }
  }
}

TEST(MountingDrawing, WithoutASensorThereIsNone) { EXPECT_TRUE(mounting_drawing({}).empty()); }

TEST(AgreementChart, ARatioOfOneLiesOnTheLineAndTwoAsFarAboveAsAHalfBelow) {
  const std::string svg =
      agreement_chart({{"a", {{1.0, 1.0, 1.0, 1.0}, {10.0, 2.0, 1.5, 2.5}, {100.0, 0.5, 0.4, 0.6}}}}, "s")
          .str();
  const auto right = all_at(svg, "class=\"right\" d=\"M([0-9.]+) ([0-9.]+)H");
  const auto dots_path = svg.substr(svg.find("class=\"dots"));
  const auto dots = all_at(dots_path, "M([0-9.]+) ([0-9.]+)h0");
  ASSERT_EQ(right.size(), 1U);
  ASSERT_EQ(dots.size(), 3U);
  EXPECT_NEAR(dots[0].y, right[0].y, 0.11);
  EXPECT_NEAR(right[0].y - dots[1].y, dots[2].y - right[0].y, 0.21);
  EXPECT_LT(dots[1].y, right[0].y);
  EXPECT_NEAR(dots[1].x - dots[0].x, dots[2].x - dots[1].x, 0.21) << "a decade is a decade";
}

TEST(AgreementChart, WhatIsBeyondStandsAtTheEdgeAndWhatIsNoNumberIsLeftOut) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::string svg =
      agreement_chart({{"a", {{1.0, 500.0, 1.0, 1e9}, {2.0, nan, nan, nan}, {3.0, 0.0, 0.0, 0.0}}}}, "s")
          .str();
  const auto dots = all_at(svg.substr(svg.find("class=\"dots")), "M([0-9.]+) ([0-9.]+)h0");
  ASSERT_EQ(dots.size(), 1U);
  EXPECT_NEAR(dots[0].y, 10.0, 0.1);
  EXPECT_TRUE(agreement_chart({{"a", {{2.0, nan, nan, nan}}}}, "s").empty());
}

TEST(Grouped, ASentenceThatSeveralShareStandsOnceWithTheirNames) {
  EXPECT_THAT(grouped({{"x", "is short"}, {"y", "is long"}, {"z", "is short"}, {"z", "is short"}}),
              ElementsAre("x, z: is short", "y: is long"));
  EXPECT_THAT(grouped_by_name({"mtx1, static: too short", "the disk is full", "mtx2, static: too short",
                               "mtx2: hot", "mtx10: hot", "the disk is full"},
                              {"mtx1", "mtx2", "mtx10"}),
              ElementsAre("mtx1, mtx2 (static): too short", "the disk is full", "mtx2, mtx10: hot"));
}

TEST(DataSheetTable, HoldsTheWhiteNoiseAgainstTheMakersNumber) {
  const auto folder = test::scratch_folder();
  test::write_synthetic_run(folder, {});
  auto run = read_run_files(folder);
  ASSERT_TRUE(run) << run.error().text();
  const auto fits = read_fits(run->models);
  for (auto& device : run->run["devices"]) {
    // 0.085 deg/s/sqrt(Hz) is 5.1 deg/sqrt(h); the made-up models have at most 4.5 at rest.
    if (device["name"] == "mtx1") device["data_sheet"] = {{"gyro_density_degps_per_sqrt_hz", 0.085}};
    if (device["name"] == "mtx2") device["data_sheet"] = {{"gyro_density_degps_per_sqrt_hz", 0.036}};
  }
  const std::string table = data_sheet_table(*run, fits).str();
  const auto row_at = [&](std::size_t at) { return table.substr(at, table.find("</tr>", at) - at); };
  const auto first = table.find("gyro random walk");
  ASSERT_NE(first, std::string::npos);
  EXPECT_THAT(row_at(first), HasSubstr(">5.1</td>"));
  EXPECT_THAT(row_at(first), HasSubstr("within</strong>"));
  EXPECT_THAT(row_at(table.find("gyro random walk", first + 1)), testing::EndsWith("–</td>"))
      << "a bound above the maker's number tells nothing";
  // Of what the maker does not say nothing is said.
  EXPECT_THAT(row_at(table.find("accel random walk")), testing::EndsWith("–</td>"));
}

}  // namespace
}  // namespace imuscope::report
