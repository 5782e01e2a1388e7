// Lines of a configuration are put in the place of those that had their keys, and nothing else changes.
#include "check/config_lines.h"

#include <gtest/gtest.h>

#include "check/check.h"
#include "tests/support/recorded_answer.h"

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

// Blanks, comments, quotes, lists over lines and tables in every form that TOML allows.
constexpr const char* kUntidy = R"(  # first
[[device]]   # one
	name	=	"a#b"  # not "s"
  axes = [ # "]"
    "+x", '-y]',	# [
    [1, 2], "\"]",
  ]
rate_hz=1


# of the table
  [ device . csv ]  # here
a = 'x#'
clock = "own"  # where
b = [
]

# of the next
[device.noise]

[[ device ]]
name = 's'
csv.clock = "common"
csv.gyro_unit = "g"
noise = {a = 1}
[device.prior]
[other]
name = "a#b"
rate_hz = 7
[[device]]
rate_hz = 5
name = "last"
)";

TEST(ConfigLines, AreWrittenIntoAnyTomlAsTheyOnceWere) {
  const std::vector<std::vector<ConfigLine>> all{
      {{"a#b", "axes", "1"}},
      {{"a#b", "rate_hz", "2"}},
      {{"a#b", "new", "3"}},
      {{"a#b", "csv.a", "4"}},
      {{"a#b", "csv.b", "5"}},
      {{"a#b", "csv.clock", "6"}},
      {{"a#b", "csv.new", "7"}},
      {{"a#b", "noise.x", "8"}},
      {{"a#b", "prior.x", "9"}},
      {{"s", "csv.clock", "10"}},
      {{"s", "csv.new", "11"}},
      {{"s", "noise.a", "12"}},
      {{"s", "prior.y", "13"}},
      {{"s", "name", "14"}},
      {{"last", "name", "15"}},
      {{"last", "rate_hz", "16"}},
      {{"last", "new", "17"}},
      {{"last", "csv.new", "18"}},
      {{"nobody", "x", "19"}},
      {{"b", "x", "20"}},
      {{"s", "csv.gyro_unit", "21"}, {"last", "x.y", "22"}, {"last", "x.z", "23"}, {"last", "x.y", "24"}}};
  std::string text;
  for (const auto& lines : all) {
    const auto written = with_lines(kUntidy, lines);
    text += "---- " + lines[0].device + ' ' + lines[0].key + '\n' +
            (written ? *written : written.error().text() + '\n');
  }
  text += with_lines("[[device]]\nname = \"a\"", {{"a", "x", "1"}}).value();
  text += with_lines("[[device]]\nname = \"a\"\nx = [\n1,\n", {{"a", "x", "1"}}).value();
  text += with_lines("", {}).value();
  test::expect_recorded("check/config_lines.txt", text);
}

TEST(ConfigLines, OfFindingsAreAllThatTheyAskFor) {
  Finding one;
  one.mends = {{"a", "k", "1"}, {"b", "l", "2"}};
  Finding other;
  other.mends = {{"c", "m", "3"}};
  const auto lines = lines_of({one, Finding{}, other});
  ASSERT_EQ(lines.size(), 3U);
  EXPECT_EQ(lines[0].device + lines[0].key + lines[0].value, "ak1");
  EXPECT_EQ(lines[2].device + lines[2].key + lines[2].value, "cm3");
}

TEST(Findings, AreSentencesWithTheirEvidence) {
  Finding finding{Harm::kWrong, "check", "dot", "it is so", 0.123456, 9.80665, "m/s2", "do that", {}};
  EXPECT_EQ(sentence(finding), "dot: it is so (0.1235 m/s2, expected 9.807); do that");
  finding.expected = 0.0;
  EXPECT_EQ(sentence(finding), "dot: it is so (0.1235 m/s2); do that");
  finding.unit.clear();
  EXPECT_EQ(sentence(finding), "dot: it is so; do that");
}

}  // namespace
}  // namespace imuscope::check
