#include "estimation/regimes/labels.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace imuscope {
namespace {

using ::testing::HasSubstr;

HostTime at(double s) { return HostTime{} + from_seconds(s); }

TEST(Labels, AFileIsReadWithItsCommentsAndSpaces) {
  const auto labels =
      parse_labels("# by hand\nbegin_s,end_s,regime\n 10, 20.5 , motorway \n\n20.5,31,gravel\n", "l.csv");
  ASSERT_TRUE(labels) << labels.error().text();
  ASSERT_EQ(labels->size(), 2u);
  EXPECT_EQ((*labels)[0].name, "motorway");
  EXPECT_EQ((*labels)[0].begin_s, 10.0);
  EXPECT_EQ((*labels)[0].end_s, 20.5);
  EXPECT_EQ((*labels)[1].name, "gravel");
}

TEST(Labels, WhatIsWrongInAFileIsToldWithItsLine) {
  const auto error_of = [](const char* text) {
    const auto labels = parse_labels(text, "l.csv");
    EXPECT_FALSE(labels);
    return labels ? std::string() : labels.error().text();
  };
  EXPECT_THAT(error_of(""), HasSubstr("holds no regime"));
  EXPECT_THAT(error_of("from,to,what\n"), HasSubstr("l.csv:1: 'from,to,what' is not the header"));
  EXPECT_THAT(error_of("begin_s,end_s,regime\n1,2\n"), HasSubstr("l.csv:2: '1,2' is no stretch"));
  EXPECT_THAT(error_of("begin_s,end_s,regime\n3,2,road\n"), HasSubstr("l.csv:2"));
  EXPECT_THAT(error_of("begin_s,end_s,regime\n1,nan,road\n"), HasSubstr("l.csv:2"));
  EXPECT_THAT(error_of("begin_s,end_s,regime\n-1e300,1e300,road\n"), HasSubstr("l.csv:2"));
  EXPECT_THAT(error_of("begin_s,end_s,regime\n12\n"), HasSubstr("l.csv:2: '12' is no stretch"));
  EXPECT_THAT(error_of("begin_s,end_s,regime\n1,5s,road\n"), HasSubstr("l.csv:2"));
  EXPECT_THAT(error_of("begin_s,end_s,regime\nnow,5,road\n"), HasSubstr("l.csv:2"));
  EXPECT_THAT(error_of("begin_s,end_s,regime\n1,1e300,road\n"), HasSubstr("l.csv:2"));
  EXPECT_THAT(error_of("begin_s,end_s,regime\n1,5, \n"), HasSubstr("l.csv:2")) << "without a name";
  EXPECT_THAT(error_of("begin_s,end_s,regime\n1,5,road,wet\n"), HasSubstr("l.csv:2"));
  EXPECT_THAT(error_of("begin_s,end_s,regime\n1,5,road\n4,6,gravel\n"),
              HasSubstr("l.csv:3: begins at 4 s, before the stretch above it ends (5 s)"));
}

TEST(Labels, UtcIsADateOrSecondsAndBecomesSecondsOfTheRun) {
  const auto labels = parse_labels(
      "begin_utc,end_utc,regime\n2026-03-14T09:30:00.25Z,2026-03-14T09:30:10Z,motorway\n"
      "1773480620.5,2026-03-14 10:30:30+01:00,gravel\n",
      "l.csv");
  ASSERT_TRUE(labels) << labels.error().text();
  ASSERT_EQ(labels->size(), 2U);
  EXPECT_DOUBLE_EQ((*labels)[0].begin_s, 1773480600.25);
  EXPECT_DOUBLE_EQ((*labels)[0].end_s, 1773480610.0);
  const auto time_of = [](UtcTime utc) {
    return std::optional(at(105.0) + (utc - utc_time_from_ns(1'773'480'600'000'000'000)));
  };
  const auto of_run = labels_of_run(*labels, at(100.0), time_of);
  ASSERT_TRUE(of_run);
  EXPECT_NEAR((*of_run)[0].begin_s, 5.25, 1e-6);
  EXPECT_NEAR((*of_run)[1].end_s, 35.0, 1e-6);
  EXPECT_DOUBLE_EQ((*labels)[1].end_s, 1773480630.0);
  EXPECT_FALSE((*of_run)[0].in_utc);
  EXPECT_FALSE(labels_of_run(*labels, at(100.0), [](UtcTime) { return std::optional<HostTime>(); }));
  for (const char* wrong :
       {"2026-03-14T09:30:00", "2026-13-14T09:30:00Z", "2026-03-14T09:30Z", "2026-03-14T24:30:00Z",
        "2026-02-30T09:30:00Z", "2026-03-14T09:30:xxZ", "-26-03-14T09:30:00Z"}) {
    EXPECT_FALSE(
        parse_labels(std::string("begin_utc,end_utc,regime\n") + wrong + ",1773480630,gravel\n", "l.csv"))
        << wrong;
  }
}

TEST(Labels, MessagesOpenAndCloseRegimesAndOthersArePassedOver) {
  const std::vector<MarkedMoment> moments{{at(30.0), "regime gravel"},
                                          {at(10.0), "regime motorway"},
                                          {at(15.0), "a bump"},
                                          {at(40.0), "regime end"},
                                          {at(55.0), "regime motorway"}};
  const auto labels = labels_of_moments(moments, at(5.0), at(65.0));
  ASSERT_EQ(labels.size(), 3u);
  EXPECT_EQ(labels[0].name, "motorway");
  EXPECT_DOUBLE_EQ(labels[0].begin_s, 5.0);
  EXPECT_DOUBLE_EQ(labels[0].end_s, 25.0);
  EXPECT_EQ(labels[1].name, "gravel");
  EXPECT_DOUBLE_EQ(labels[1].end_s, 35.0);
  EXPECT_DOUBLE_EQ(labels[2].begin_s, 50.0);
  EXPECT_DOUBLE_EQ(labels[2].end_s, 60.0) << "held until the end of the run";

  const auto track = labelled_regimes(labels, at(5.0));
  EXPECT_EQ(track.names(), (std::vector<std::string>{"motorway", "gravel"}));
  EXPECT_EQ(track.at(at(9.9)), std::nullopt);
  EXPECT_EQ(track.at(at(10.0)), 0u);
  EXPECT_EQ(track.at(at(30.0)), 1u);
  EXPECT_EQ(track.at(at(45.0)), std::nullopt) << "between two labels no regime holds";
  EXPECT_DOUBLE_EQ(track.total_s(0), 30.0);
  EXPECT_DOUBLE_EQ(track.longest_s(0), 20.0);
}

TEST(Labels, AFileOfASpreadsheetIsReadWithItsByteOrderMarkAndLineEnds) {
  const auto labels = parse_labels(
      "\xEF\xBB\xBF"
      "begin_s,end_s,regime\r\n10,20.5,motorway\r\n20.5,31,gravel",
      "l.csv");
  ASSERT_TRUE(labels) << labels.error().text();
  ASSERT_EQ(labels->size(), 2u);
  EXPECT_EQ((*labels)[1].name, "gravel");
}

TEST(Labels, AMessageMayEndItsLineAndQuoteItsNameAndMeansTheSame) {
  const auto labels = labels_of_moments({{at(10.0), "regime gravel\n"},
                                         {at(20.0), "regime \"gravel\""},
                                         {at(30.0), "regime end\n"},
                                         {at(40.0), "regime wet, dirty"},
                                         {at(50.0), "regime \"\""},
                                         {at(60.0), "regime \n"}},
                                        at(0.0), at(70.0));
  ASSERT_EQ(labels.size(), 3u);
  EXPECT_EQ(labels[0].name, "gravel");
  EXPECT_EQ(labels[1].name, "gravel");
  EXPECT_DOUBLE_EQ(labels[1].end_s, 30.0);
  EXPECT_EQ(labels[2].name, "wet  dirty") << "a comma would break the line of a table";
  EXPECT_DOUBLE_EQ(labels[2].end_s, 50.0) << "a name of nothing ends what was";
}

TEST(Labels, ARegimeNamedAfterTheEndOfTheRunHasNoLength) {
  const auto labels =
      labels_of_moments({{at(10.0), "regime gravel"}, {at(50.0), "regime snow"}}, at(0.0), at(40.0));
  ASSERT_EQ(labels.size(), 2u);
  EXPECT_DOUBLE_EQ(labels[1].begin_s, labels[1].end_s);
  const auto track = labelled_regimes(labels, at(0.0));
  EXPECT_EQ(track.at(at(50.0)), std::nullopt);
  EXPECT_EQ(track.stretches().size(), 1u);
  EXPECT_EQ(track.index_of("snow"), 1u);
  EXPECT_EQ(track.index_of("rain"), std::nullopt);
}

TEST(Labels, TwoStretchesOfOneNameThatTouchAreOne) {
  const auto track =
      labelled_regimes({{0.0, 10.0, "road"}, {10.0, 20.0, "road"}, {25.0, 30.0, "road"}}, at(0.0));
  ASSERT_EQ(track.stretches().size(), 2u);
  EXPECT_DOUBLE_EQ(track.longest_s(0), 20.0);
}

TEST(Labels, ANameIsALineOfTextThatIsNotTooLong) {
  for (const std::string& name : {std::string("\xff"), std::string("a\x1b[31m"), std::string("a\"b"),
                                  std::string(kRegimeNameMax + 1, 'x'), std::string("\u0085x")}) {
    const auto labels = parse_labels("begin_s,end_s,regime\n1,2," + name + "\n", "l.csv");
    ASSERT_FALSE(labels) << name;
    EXPECT_THAT(labels.error().what, HasSubstr("l.csv:2"));
    EXPECT_EQ(labels.error().what.find('\x1b'), std::string::npos);
  }
  EXPECT_TRUE(parse_labels("begin_s,end_s,regime\n1,2," + std::string(kRegimeNameMax, 'x') + "\n", "l.csv"));
}

TEST(Labels, WhateverIsSentOnTheNetworkBecomesANameOfUtf8WithoutControlCharacters) {
  const auto labels = labels_of_moments(
      {{at(1.0), "regime \xff\x1b]0;x\a"}, {at(2.0), "regime " + std::string(9'000, 'x')}}, at(0.0), at(3.0));
  ASSERT_EQ(labels.size(), 2U);
  EXPECT_EQ(labels[0].name, "??]0;x?");
  EXPECT_EQ(labels[1].name.size(), kRegimeNameMax);
}

}  // namespace
}  // namespace imuscope
