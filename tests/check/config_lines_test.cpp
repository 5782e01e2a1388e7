// Lines of a configuration are put in the place of those that had their keys, and nothing else changes.
#include "check/config_lines.h"

#include <gtest/gtest.h>

namespace imuscope::check {
namespace {

constexpr const char* kToml = R"(# of my car
[run]
name = "a" # [[device]]

[[device]]
name = "r"
role = "reference"
axes = [
  [1, 0, 0], # forward
  [0, 1, 0],
  [0, 0, 1],
]
rate_hz = 100.0

# The other one.
[[device]]
name = "s" # not "r"
csv.gyro_unit = "rad/s"

[ [ device ] ]
name = "t"
[device.csv]
clock = "own"

[device.noise]
gyro_white_sd_degps = 0.5

[lcm]
bridge = true
)";

TEST(ConfigLines, AKeyThatIsThereIsReplacedWhereverItsValueEnds) {
  std::string expected = kToml;
  const auto begin = expected.find("axes = [");
  const auto end = expected.find("]\nrate_hz") + 1;
  expected.replace(begin, end - begin, "axes = \"+x -y -z\"");
  EXPECT_EQ(with_lines(kToml, {{"r", "axes", "\"+x -y -z\""}}).value(), expected);
}

TEST(ConfigLines, AKeyThatIsAbsentGoesBehindTheLastOfItsTable) {
  std::string expected = kToml;
  expected.insert(expected.find("\n[device.noise]"), "gyro_unit = \"deg/s\"\n");
  EXPECT_EQ(with_lines(kToml, {{"t", "csv.gyro_unit", "\"deg/s\""}}).value(), expected);
}

TEST(ConfigLines, ATableThatIsAbsentGoesBehindTheKeysOfItsDeviceNotBehindTheCommentOfTheNext) {
  std::string expected = kToml;
  expected.insert(expected.find("\n# The other one."), "[device.csv]\nclock = \"own\"\n");
  EXPECT_EQ(with_lines(kToml, {{"r", "csv.clock", "\"own\""}}).value(), expected);
}

TEST(ConfigLines, ADottedKeyStaysDotted) {
  std::string expected = kToml;
  expected.replace(expected.find("\"rad/s\""), 7, "\"deg/s\"");
  EXPECT_EQ(with_lines(kToml, {{"s", "csv.gyro_unit", "\"deg/s\""}}).value(), expected);
}

TEST(ConfigLines, TheLaterOfTwoLinesCounts) {
  const auto text = with_lines(kToml, {{"r", "rate_hz", "50.0"}, {"r", "rate_hz", "25.0"}}).value();
  EXPECT_EQ(text.find("50.0"), std::string::npos);
  EXPECT_NE(text.find("rate_hz = 25.0"), std::string::npos);
}

TEST(ConfigLines, WhatCannotBeWrittenIsToldWithTheLine) {
  const auto inline_table = with_lines("[[device]]\nname = \"s\"\ncsv = { clock = \"own\" }\n",
                                       {{"s", "csv.gyro_unit", "\"deg/s\""}});
  ASSERT_FALSE(inline_table.has_value());
  EXPECT_NE(inline_table.error().text().find("gyro_unit = \"deg/s\""), std::string::npos);
  EXPECT_FALSE(with_lines(kToml, {{"u", "rate_hz", "1.0"}}).has_value());
}

}  // namespace
}  // namespace imuscope::check
