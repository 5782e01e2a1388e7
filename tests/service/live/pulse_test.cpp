#include "service/live/pulse.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <array>

namespace imuscope {
namespace {

using std::chrono::seconds;
using testing::ElementsAre;
using testing::Field;
using testing::IsEmpty;

constexpr HostTime kBegin{std::chrono::hours(1)};

class PulseTest : public testing::Test {
 protected:
  Heartbeat io_{kBegin};
  Heartbeat recorder_{kBegin};
  std::array<Pulse, 2> pulses_{Pulse{"io", &io_, kCoreTold, kCoreGivenUp},
                               Pulse{"rec", &recorder_, kWriterTold, kWriterGivenUp}};
};

TEST_F(PulseTest, WhatMovesIsAlive) {
  for (int i = 0; i < 1000; ++i) {
    const HostTime now = kBegin + i * std::chrono::milliseconds(100);
    io_.beat(now);
    recorder_.beat(now);
    EXPECT_TRUE(all_alive(pulses_, now));
    EXPECT_THAT(standing_threads(pulses_, now), IsEmpty());
  }
}

TEST_F(PulseTest, AStandingCoreThreadIsToldAndGivenUpSoon) {
  recorder_.beat(kBegin + seconds(10));
  EXPECT_THAT(standing_threads(pulses_, kBegin + seconds(10)),
              ElementsAre(Field(&Condition::what, "the thread io has stood still for 10 s")));
  EXPECT_FALSE(all_alive(pulses_, kBegin + seconds(10)));
  io_.beat(kBegin + seconds(10));
  EXPECT_TRUE(all_alive(pulses_, kBegin + seconds(10))) << "it came back";
}

TEST_F(PulseTest, ARecorderThatWaitsForTheDiskIsToldAndGivenItsTime) {
  io_.beat(kBegin + seconds(14));
  EXPECT_THAT(standing_threads(pulses_, kBegin + seconds(14)),
              ElementsAre(Field(&Condition::what, "the thread rec has stood still for 14 s")));
  EXPECT_TRUE(all_alive(pulses_, kBegin + seconds(14)));
  io_.beat(kBegin + seconds(61));
  EXPECT_FALSE(all_alive(pulses_, kBegin + seconds(61)));
}

}  // namespace
}  // namespace imuscope
