/// What a CAN line's interface and counters say together, by a kernel that is made up.

#include "service/lines/can_watch.h"

#include <gtest/gtest.h>

#include <string>

#include "made_can_kernel.h"
#include "made_can_link.h"

namespace imuscope {
namespace {

using std::chrono::milliseconds;

class CanWatchTest : public testing::Test {
 protected:
  CanWatchTest() { test::made_can_kernel() = {}; }
  /// After 800 ms in which so many frames came, for the decoder and besides.
  std::string look(std::uint64_t frames, std::uint64_t others = 0, std::uint64_t errors = 0) {
    constexpr std::uint64_t kErrorBytes = kCanRecordHeaderBytes + 8;
    line_.counters.frames += frames;
    line_.counters.bytes += frames * kCanRecordHeaderBytes + errors * kErrorBytes;
    link_.frames_received += frames + others;
    test::made_can_kernel().answer = test::link_answer(link_);
    now_ += milliseconds(800);
    return watch_.look(line_, now_);
  }

  CanWatch watch_{"can7", {{0x0AA, false}, {0x18DAF110, true}}};
  test::MadeLink link_{.state = CAN_STATE_ERROR_ACTIVE, .mode = 0};
  LineStatus line_;
  HostTime now_{std::chrono::seconds(100)};
};

TEST_F(CanWatchTest, WhileItsFramesComeNothingIsSaid) {
  for (int i = 0; i < 5; ++i) EXPECT_EQ(look(7), "");
}

TEST_F(CanWatchTest, SilenceIsToldAfterASecondWithWhatElseTravels) {
  EXPECT_EQ(look(0), "") << "nothing is known yet";
  EXPECT_EQ(look(0), "");
  const std::string silent = look(0);
  EXPECT_NE(silent.find("can7"), std::string::npos) << silent;
  const std::string beside = look(0, 40);
  EXPECT_NE(beside, silent);
  EXPECT_NE(beside.find("0AA, 18DAF110"), std::string::npos) << beside;
  const std::string damaged = look(0, 3, 3);
  EXPECT_NE(damaged, beside);
  EXPECT_EQ(damaged.find("0AA, 18DAF110"), std::string::npos) << "error frames are nobody's: " << damaged;
  EXPECT_EQ(look(1), "");
  EXPECT_EQ(look(0), "") << "silent for less than a second";
}

TEST_F(CanWatchTest, FramesThatThisPcLostAreToldOnce) {
  line_.frames_dropped = 9;
  EXPECT_EQ(look(7), "") << "lost before this run looked";
  line_.frames_dropped = 12;
  const std::string lost = look(7);
  EXPECT_TRUE(lost.starts_with("3 frames of can7 were lost")) << lost;
  EXPECT_EQ(look(7), "");
}

TEST_F(CanWatchTest, AnInterfaceThatIsDownOrGoneIsTold) {
  link_.flags = 0;
  const std::string down = look(7);
  EXPECT_TRUE(down.starts_with("can7 is down")) << down;
  test::made_can_kernel().netlink_error = EACCES;
  EXPECT_NE(look(7), "");
}

TEST(CanWatch, OfManyIdentifiersTheFirstEightAreNamed) {
  test::made_can_kernel() = {};
  std::vector<CanId> ids;
  for (std::uint32_t id = 1; id <= 9; ++id) ids.push_back({id, false});
  for (const bool all : {true, false}) {
    CanWatch watch("can7", ids);
    test::MadeLink link{.state = CAN_STATE_ERROR_ACTIVE, .mode = 0};
    test::made_can_kernel().answer = test::link_answer(link);
    EXPECT_EQ(watch.look({}, HostTime{std::chrono::seconds(100)}), "");
    link.frames_received += 5;
    test::made_can_kernel().answer = test::link_answer(link);
    const std::string text = watch.look({}, HostTime{std::chrono::seconds(102)});
    EXPECT_NE(text.find("001, 002, 003, 004, 005, 006, 007, 008"), std::string::npos) << text;
    EXPECT_EQ(text.find("..."), all ? text.find("008, ...") + 5 : std::string::npos) << text;
    ids.pop_back();
  }
}

}  // namespace
}  // namespace imuscope
