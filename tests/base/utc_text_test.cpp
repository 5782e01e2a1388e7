#include "base/utc_text.h"

#include <gtest/gtest.h>

namespace imuscope {
namespace {

double seconds_of(std::string_view text) {
  const auto utc = parse_utc_text(text);
  EXPECT_TRUE(utc) << text;
  return utc ? utc->since_1970_s : 0.0;
}

// The seconds are those of `date -u -d TEXT +%s`.
TEST(UtcText, DatesAreSecondsSince1970) {
  EXPECT_EQ(seconds_of("1970-01-01T00:00:00Z"), 0.0);
  EXPECT_EQ(seconds_of("1969-12-31T23:59:59Z"), -1.0);
  EXPECT_EQ(seconds_of("2000-02-29T12:00:00Z"), 951825600.0);
  EXPECT_EQ(seconds_of("2026-03-14T09:30:12.25Z"), 1773480612.25);
  EXPECT_EQ(seconds_of("2026-03-14t09:30:12z"), 1773480612.0);
  EXPECT_EQ(seconds_of("2026-03-14 23:59:59.5Z"), 1773532799.5);
}

TEST(UtcText, ALeapSecondIsTheFirstOfTheNextMinute) {
  EXPECT_EQ(seconds_of("2016-12-31T23:59:60.5Z"), seconds_of("2017-01-01T00:00:00.5Z"));
  EXPECT_FALSE(parse_utc_text("2016-12-31T23:59:61Z"));
}

TEST(UtcText, AZoneIsTakenOffAndSaysThatItWasThere) {
  const double utc_s = seconds_of("2026-03-14T09:30:12Z");
  EXPECT_EQ(seconds_of("2026-03-14T10:30:12+01:00"), utc_s);
  EXPECT_EQ(seconds_of("2026-03-14T04:00:12-0530"), utc_s);
  EXPECT_EQ(seconds_of("2026-03-14T18:30:12+09"), utc_s);
  EXPECT_EQ(seconds_of("2026-03-14T09:30:12"), utc_s);
  EXPECT_TRUE(parse_utc_text("2026-03-14T09:30:12Z")->has_zone);
  EXPECT_TRUE(parse_utc_text("2026-03-14T09:30:12+00:00")->has_zone);
  EXPECT_FALSE(parse_utc_text("2026-03-14T09:30:12")->has_zone);
}

TEST(UtcText, WhatIsNoDateOrNoTimeIsRefused) {
  for (const char* wrong : {"",
                            "2026",
                            "2026-03-14",
                            "2026-03-14T",
                            "2026-03-14T09",
                            "2026-03-14T09:30",
                            "2026-03-14T09:30:Z",
                            "2026-3-14T09:30:12Z",
                            "26-03-14T09:30:12Z",
                            "-026-03-14T09:30:12Z",
                            "2026-13-01T00:00:00Z",
                            "2026-00-01T00:00:00Z",
                            "2025-02-29T00:00:00Z",
                            "2026-04-31T00:00:00Z",
                            "2026-03-14T24:00:00Z",
                            "2026-03-14T09:60:00Z",
                            "2026-03-14T09:30:12.2.5Z",
                            "2026-03-14T09:30:xxZ",
                            "2026-03-14T09:30:-1Z",
                            "2026-03-14x09:30:12Z",
                            "2026-03-14T09-30:12Z",
                            "2026/03/14T09:30:12Z",
                            "2026-03-14T09:30:12Zulu",
                            "2026-03-14T09:30:12+1",
                            "2026-03-14T09:30:12+01:0",
                            "2026-03-14T09:30:12+01:",
                            "2026-03-14T09:30:12+24:00",
                            "2026-03-14T09:30:12+01:60",
                            "2026-03-14T09:30:12+01:00h",
                            " 2026-03-14T09:30:12Z",
                            "1773480612.25"}) {
    EXPECT_FALSE(parse_utc_text(wrong)) << wrong;
  }
}

}  // namespace
}  // namespace imuscope
