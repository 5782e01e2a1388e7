/// Who keeps the PC's clock: texts as chrony 4 and linuxptp 3 print them, programs that hang or say nonsense.

#include "service/run/clock_keepers.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <thread>

namespace imuscope {
namespace {

TEST(ClockKeepers, ChronysLineIsRead) {
  const auto keeper = read_chrony_tracking(
      "A29FC87B,162.159.200.123,4,1763961600.123456789,-0.000012345,0.000001234,0.000023456,-12.345,0.001,0."
      "052,"
      "0.012345678,0.000987654,64.2,Normal\n");
  ASSERT_TRUE(keeper);
  EXPECT_EQ(keeper->name, "chrony");
  EXPECT_EQ(keeper->source, "162.159.200.123");
  EXPECT_EQ(keeper->stratum, 4);
  EXPECT_TRUE(keeper->is_synchronised);
  EXPECT_DOUBLE_EQ(keeper->offset_s, 12.345e-6) << "chrony's sign is that of a slow clock";
  EXPECT_DOUBLE_EQ(keeper->sd_s, 23.456e-6);
  EXPECT_NEAR(keeper->max_error_s, 12.345e-6 + 0.000987654 + 0.5 * 0.012345678, 1e-12);
  EXPECT_DOUBLE_EQ(keeper->frequency_ppm, -12.345);
  const auto alone =
      read_chrony_tracking("7F7F0101,,0,0.0,0.0,0.0,0.0,0.0,0.0,0.0,1.0,1.0,0.0,Not synchronised\n");
  ASSERT_TRUE(alone);
  EXPECT_FALSE(alone->is_synchronised);
}

TEST(ClockKeepers, WhatIsNoLineOfChronysIsNone) {
  for (const char* text : {"", "506 Cannot talk to daemon", "a,b,c", "A,B,C,D,E,F,G,H,I,J,K,L,M,N",
                           "A29FC87B,x,4,1.0,nan,0,0,0,0,0,0,0,0,Normal"})
    EXPECT_FALSE(read_chrony_tracking(text)) << text;
}

TEST(ClockKeepers, PtpsAnswersAreRead) {
  const auto keeper = read_ptp_management(
      "sending: GET CURRENT_DATA_SET\n"
      "\t507c6f.fffe.1fb16a-0 seq 0 RESPONSE MANAGEMENT CURRENT_DATA_SET\n"
      "\t\tstepsRemoved     1\n"
      "\t\toffsetFromMaster -212.0\n"
      "\t\tmeanPathDelay    5430.0\n"
      "sending: GET PARENT_DATA_SET\n"
      "\t507c6f.fffe.1fb16a-0 seq 1 RESPONSE MANAGEMENT PARENT_DATA_SET\n"
      "\t\tparentPortIdentity                    001122.fffe.334455-1\n"
      "\t\tgrandmasterIdentity                   001122.fffe.334455\n");
  ASSERT_TRUE(keeper);
  EXPECT_EQ(keeper->name, "ptp4l");
  EXPECT_EQ(keeper->source, "001122.fffe.334455");
  EXPECT_EQ(keeper->stratum, 1);
  EXPECT_TRUE(keeper->is_synchronised);
  EXPECT_DOUBLE_EQ(keeper->offset_s, -212e-9);
  EXPECT_DOUBLE_EQ(keeper->max_error_s, 5642e-9);
  EXPECT_FALSE(read_ptp_management("sending: GET CURRENT_DATA_SET\n"));
}

TEST(ClockKeepers, TheClockOfACardIsOfTaiOrOfUtcOrOfNobody) {
  const ClockKeeper tai = card_clock("/dev/ptp0", 37.0 - 3e-6, 2e-6);
  EXPECT_TRUE(tai.is_synchronised);
  EXPECT_NEAR(tai.offset_s, 3e-6, 1e-12) << "the wall clock is ahead";
  EXPECT_DOUBLE_EQ(tai.max_error_s, 1e-6);
  EXPECT_NEAR(card_clock("/dev/ptp0", -0.25e-3, 2e-6).offset_s, 0.25e-3, 1e-12);
  const ClockKeeper unset = card_clock("/dev/ptp1", -1.7e9, 2e-6);
  EXPECT_FALSE(unset.is_synchronised);
  EXPECT_DOUBLE_EQ(unset.offset_s, 1.7e9);
}

TEST(ClockKeepers, OfTheReadingsOfACardTheClosestPairCounts) {
  constexpr std::int64_t kNow = 1'763'961'600'123'456'789;
  constexpr std::int64_t kTai = 37'000'000'000;
  const std::vector<CardReading> readings{{kNow, kNow + kTai + 900, kNow + 2500},
                                          {kNow + 3000, kNow + kTai + 4100, kNow + 4500},
                                          {kNow + 9000, kNow + kTai, kNow + 8000},
                                          {kNow + 10000, kNow + kTai + 900'000, kNow + 12000}};
  const auto found = card_difference(readings);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->card_minus_wall_s, 37.0 + 350e-9, 1e-12);
  EXPECT_NEAR(found->apart_s, 1500e-9, 1e-15);
  EXPECT_FALSE(card_difference(std::span(readings).subspan(2, 1)));
  EXPECT_FALSE(card_difference({}));
}

TEST(ClockKeepers, AProgramThatHangsIsEndedAndOneThatFailsTellsNothing) {
  const auto said = output_of({"/bin/sh", "-c", "echo $HOME one"});
  ASSERT_TRUE(said);
  EXPECT_EQ(*said, "one\n") << "its environment is empty";
  EXPECT_FALSE(output_of({"/bin/sh", "-c", "echo one; exit 1"}));
  EXPECT_FALSE(output_of({"/no/such/program"}));
  EXPECT_FALSE(output_of({"/bin/sh", "-c", "exec yes"})) << "more than anybody has to say";
  const auto began = std::chrono::steady_clock::now();
  EXPECT_FALSE(output_of({"/bin/sleep", "60"}));
  EXPECT_LT(std::chrono::steady_clock::now() - began, std::chrono::seconds(30));
}

TEST(ClockKeepers, AreAskedBesidesAndAnswerOnce) {
  std::atomic<int> asked{0};
  ClockKeeperInquiry inquiry([&] {
    ++asked;
    ClockKeeper keeper;
    keeper.name = "chrony";
    return std::vector<ClockKeeper>{keeper};
  });
  EXPECT_FALSE(inquiry.take());
  for (int round = 1; round <= 2; ++round) {
    inquiry.begin();
    inquiry.begin();
    std::optional<std::vector<ClockKeeper>> answer;
    while (!answer) {
      answer = inquiry.take();
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    EXPECT_EQ(answer->size(), 1U);
    EXPECT_EQ(asked.load(), round);
    EXPECT_FALSE(inquiry.take());
  }
}

}  // namespace
}  // namespace imuscope
