#include "publish/receive_age.h"

#include <gtest/gtest.h>

namespace imuscope {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr ReceiveAge::Time kBoot = hours(5);
constexpr ReceiveAge::Time kWall = hours(480'000);

/// Both clocks `later` than nothing waited, the wall clock stepped by `step` meanwhile.
ReceiveAge::Clocks at(ReceiveAge::Time later, ReceiveAge::Time step = {}) {
  return {kBoot + later, kWall + later + step};
}

TEST(ReceiveAge, IsTheTimeSinceTheKernelsStamp) {
  const ReceiveAge age(at({}));
  EXPECT_EQ(age.of(kWall + milliseconds(30), at(milliseconds(100))), milliseconds(70));
  EXPECT_EQ(age.of(kWall + milliseconds(100), at(milliseconds(100))), milliseconds(0));
}

TEST(ReceiveAge, AStepOfTheWallClockBeforeOrAfterTheStampMakesNoDifference) {
  for (const ReceiveAge::Time step :
       std::initializer_list<ReceiveAge::Time>{hours(1), -hours(1), seconds(1), -seconds(1)}) {
    const ReceiveAge age(at({}));
    const auto now = at(milliseconds(100), step);
    EXPECT_EQ(age.of(kWall + milliseconds(30), now), milliseconds(70)) << "stepped while it waited";
    EXPECT_EQ(age.of(kWall + milliseconds(30) + step, now), milliseconds(70)) << "stepped before";
  }
}

TEST(ReceiveAge, AStepIsForgottenOnceNothingWaits) {
  ReceiveAge age(at({}));
  const auto after_step = [](ReceiveAge::Time later) { return at(later, hours(1)); };
  age.nothing_waited(after_step(seconds(1)));
  EXPECT_EQ(age.of(after_step(seconds(2)).wall, after_step(seconds(3))), seconds(1));
  EXPECT_EQ(age.of(kWall + seconds(2), after_step(seconds(3))), milliseconds(0)) << "of no moment since";
}

}  // namespace
}  // namespace imuscope
