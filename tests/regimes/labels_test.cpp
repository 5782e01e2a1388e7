#include "regimes/labels.h"

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
  EXPECT_THAT(error_of("begin_s,end_s,regime\n1,5,road\n4,6,gravel\n"),
              HasSubstr("l.csv:3: begins at 4 s, before the stretch above it ends (5 s)"));
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

}  // namespace
}  // namespace imuscope
