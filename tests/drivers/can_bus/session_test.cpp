#include "drivers/can_bus/session.h"

#include <gmock/gmock.h>

#include <vector>

#include "tests/support/recorded_answer.h"

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

/// Every class and every status alone and together with a neighbour, as it is reported, described and told.
TEST(CanSession, WholeAnswers) {
  std::string text;
  const auto add = [&](const CanFrame& frame) {
    const CanErrorReport r = read_can_error(frame);
    text += describe_can_error(frame) + " | " + (r.state ? std::to_string(static_cast<int>(*r.state)) : "-") +
            (r.restarted ? " restarted" : "") + (r.receive_overflow ? " rx" : "") +
            (r.transmit_overflow ? " tx" : "") + (r.not_acknowledged ? " nack" : "") +
            (r.bus_error ? " bus" : "") + ' ' + std::to_string(r.has_counts) + ' ' +
            std::to_string(r.transmit_errors) + ' ' + std::to_string(r.receive_errors) + '\n';
  };
  for (unsigned bit = 0; bit < 12; ++bit) {
    add(error_frame(1U << bit, {0, 0x15, 3, 4, 5, 6, 70, 80}));
    add(error_frame(1U << bit | 0x04U, {0, 0x2A, 3, 4, 5, 6, 70, 80}));
    add(error_frame(1U << bit | 0x240U, {0, 0, 3, 4, 5, 6, 70, 80}));
  }
  for (unsigned status = 0; status < 256; ++status)
    add(error_frame(0x04, {0, static_cast<std::uint8_t>(status), 0, 0, 0, 0, 1, 2}));
  test::expect_recorded("drivers/can_bus/errors.txt", text);

  std::string told;
  const std::vector<CanFrame> frames{kWarning,  kPassive,         kActive,    kBusOff,
                                     kBusError, kReceiveOverflow, kRestarted, data_frame()};
  for (const CanFrame& first : frames) {
    for (const CanFrame& second : frames) {
      CanSession session;
      HostTime now{};
      const auto step = [&](Duration wait, const CanFrame* frame) {
        now += wait;
        if (frame != nullptr) {
          std::vector<std::uint8_t> record(kCanRecordMaxBytes);
          record.resize(write_can_record(*frame, record));
          session.on_bytes(record, now);
        }
        static_cast<void>(session.poll(now));
        told += std::to_string(static_cast<int>(session.state())) +
                std::to_string(static_cast<int>(session.bus_state())) + ' ' +
                std::to_string(session.error_frames()) + std::to_string(session.overflows()) + ' ' +
                std::string(session.problem().substr(0, 30)) + " | ";
      };
      step(seconds{1}, &first), step(milliseconds{500}, &second), step(seconds{1}, nullptr),
          step(milliseconds{1}, nullptr), step(seconds{8} + milliseconds{999}, nullptr),
          step(milliseconds{1}, nullptr), step(milliseconds{1}, &second);
      told += '\n';
    }
  }
  test::expect_recorded("drivers/can_bus/told.txt", told);
}

}  // namespace
}  // namespace imuscope
