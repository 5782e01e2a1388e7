#include "drivers/can_bus/session.h"

#include <gmock/gmock.h>

#include <vector>

namespace imuscope {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::HasSubstr;

CanFrame error_frame(std::uint32_t classes, std::array<std::uint8_t, 8> data) {
  CanFrame frame;
  frame.is_error = true;
  frame.id = classes;
  frame.length = 8;
  std::copy(data.begin(), data.end(), frame.data.begin());
  return frame;
}

CanFrame data_frame() {
  CanFrame frame;
  frame.id = 0x0AA;
  frame.length = 8;
  return frame;
}

// What the kernel's slcan driver makes of the adapter's lines "sw100120", "sp130140", "sa000000", "sb255255",
// receive errors first in the line, last in the frame.
const CanFrame kWarning = error_frame(0x204, {0, 0x08, 0, 0, 0, 0, 120, 100});
const CanFrame kPassive = error_frame(0x204, {0, 0x20, 0, 0, 0, 0, 140, 130});
const CanFrame kActive = error_frame(0x204, {0, 0x40, 0, 0, 0, 0, 0, 0});
const CanFrame kBusOff = error_frame(0x40, {});
const CanFrame kBusError = error_frame(0x88, {});
const CanFrame kReceiveOverflow = error_frame(0x04, {0, 0x01, 0, 0, 0, 0, 0, 0});
const CanFrame kRestarted = error_frame(0x100, {});

class CanSessionTest : public testing::Test {
 protected:
  void hear(const CanFrame& frame) {
    std::vector<std::uint8_t> record(kCanRecordMaxBytes);
    record.resize(write_can_record(frame, record));
    session_.on_bytes(record, now_);
  }
  void wait(Duration duration) {
    now_ += duration;
    EXPECT_TRUE(session_.poll(now_).empty());
  }

  HostTime now_ = host_time_from_ns(1'000'000'000);
  CanSession session_;
};

TEST_F(CanSessionTest, StreamsWhileFramesComeAndNoLonger) {
  EXPECT_EQ(session_.state(), SessionState::kConnecting);
  hear(data_frame());
  EXPECT_EQ(session_.state(), SessionState::kStreaming);
  wait(milliseconds(900));
  EXPECT_EQ(session_.state(), SessionState::kStreaming);
  wait(milliseconds(200));
  EXPECT_EQ(session_.state(), SessionState::kConnecting);
  hear(data_frame());
  EXPECT_EQ(session_.state(), SessionState::kStreaming);
  EXPECT_EQ(session_.problem(), "");
}

TEST_F(CanSessionTest, FollowsTheControllerThroughItsStates) {
  hear(data_frame());
  hear(kWarning);
  EXPECT_EQ(session_.bus_state(), CanBusState::kWarning);
  EXPECT_EQ(session_.problem(), "") << "frames still come";
  hear(kPassive);
  EXPECT_EQ(session_.bus_state(), CanBusState::kPassive);
  EXPECT_THAT(std::string(session_.problem()), HasSubstr("error-passive"));
  hear(kActive);
  EXPECT_EQ(session_.bus_state(), CanBusState::kActive);
  EXPECT_EQ(session_.problem(), "");
  EXPECT_EQ(session_.error_frames(), 3U);
}

TEST_F(CanSessionTest, BusOffIsToldUntilTheControllerIsBack) {
  hear(kBusOff);
  EXPECT_THAT(std::string(session_.problem()), HasSubstr("bus-off (time 1)"));
  EXPECT_THAT(std::string(session_.problem()), HasSubstr("type can restart"));
  wait(seconds(60));
  EXPECT_THAT(std::string(session_.problem()), HasSubstr("bus-off"));
  hear(kRestarted);
  EXPECT_EQ(session_.problem(), "");
  hear(kBusOff);
  EXPECT_THAT(std::string(session_.problem()), HasSubstr("bus-off (time 2)"));
  hear(data_frame());
  EXPECT_EQ(session_.problem(), "") << "what is heard was not sent to a dead controller";
}

TEST_F(CanSessionTest, ErrorsWithoutFramesAreAWrongBitRate) {
  hear(kBusError);
  EXPECT_THAT(std::string(session_.problem()), HasSubstr("bit rate"));
  EXPECT_EQ(session_.state(), SessionState::kConnecting) << "an error frame is no sign of life";
  hear(data_frame());
  EXPECT_EQ(session_.problem(), "");
  // A single damaged frame on a bus that works is not worth a word.
  hear(kBusError);
  EXPECT_EQ(session_.problem(), "");
  wait(seconds(2));
  EXPECT_THAT(std::string(session_.problem()), HasSubstr("only error frames"));
}

TEST_F(CanSessionTest, OverflowOfTheControllerIsCountedAndToldForAWhile) {
  hear(data_frame());
  hear(kReceiveOverflow);
  hear(kReceiveOverflow);
  EXPECT_EQ(session_.overflows(), 2U);
  EXPECT_THAT(std::string(session_.problem()), HasSubstr("2 times"));
  for (int i = 0; i < 110; ++i) {
    wait(milliseconds(100));
    hear(data_frame());
  }
  EXPECT_EQ(session_.problem(), "");
}

TEST(CanErrorFrame, IsDescribedInWords) {
  EXPECT_EQ(describe_can_error(kWarning), "controller: transmit warning; errors: transmit 120, receive 100");
  EXPECT_EQ(describe_can_error(kBusOff), "bus-off");
  EXPECT_EQ(describe_can_error(kBusError), "protocol violation, bus error");
  EXPECT_EQ(describe_can_error(error_frame(0x400, {})), "class 00000400");
  EXPECT_EQ(describe_can_error(error_frame(0x004, {})), "controller") << "without a status";
  EXPECT_EQ(describe_can_error(error_frame(0x200, {0, 0, 0, 0, 0, 0, 7, 9})),
            "errors: transmit 7, receive 9");
}

}  // namespace
}  // namespace imuscope
