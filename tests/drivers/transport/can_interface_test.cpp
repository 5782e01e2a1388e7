#include "drivers/transport/can_interface.h"

#include <gmock/gmock.h>

namespace imuscope {
namespace {

using testing::AllOf;
using testing::HasSubstr;

CanInterface working() {
  CanInterface interface;
  interface.name = "can0";
  interface.kind = "can";
  interface.is_up = true;
  interface.state = CanControllerState::kActive;
  interface.bit_rate = 250'000;
  return interface;
}

CanObservation silent() {
  CanObservation seen;
  seen.silent_s = 4.2;
  seen.ids = "0AA, 18FF0100";
  return seen;
}

TEST(CanTrouble, NothingIsSaidOfABusThatWorks) { EXPECT_EQ(explain_can_trouble(working(), {}), ""); }

TEST(CanTrouble, InterfaceThatIsDownGetsTheCommandThatBringsItUp) {
  auto interface = working();
  interface.is_up = false;
  EXPECT_EQ(explain_can_trouble(interface, silent()),
            "can0 is down; sudo ip link set can0 up type can bitrate 250000 restart-ms 100");
  interface.kind = "vcan";
  EXPECT_EQ(explain_can_trouble(interface, silent()), "can0 is down; sudo ip link set can0 up");
}

TEST(CanTrouble, BusOffNamesTheRestart) {
  auto interface = working();
  interface.state = CanControllerState::kBusOff;
  EXPECT_THAT(explain_can_trouble(interface, silent()),
              AllOf(HasSubstr("bus-off"), HasSubstr("sudo ip link set can0 type can restart")));
  interface.restart_ms = 100;
  EXPECT_THAT(explain_can_trouble(interface, silent()), HasSubstr("starts again every 100 ms"));
}

TEST(CanTrouble, ErrorsWithoutFramesMeanAWrongBitRate) {
  auto interface = working();
  interface.state = CanControllerState::kPassive;
  interface.rx_errors = 135;
  const auto by_state = explain_can_trouble(interface, silent());
  EXPECT_THAT(by_state, AllOf(HasSubstr("only errors at 250000 bit/s"), HasSubstr("state error-passive"),
                              HasSubstr("bit rate is probably not the bus's")));
  auto seen = silent();
  seen.error_frames = 12;
  EXPECT_THAT(explain_can_trouble(working(), seen), HasSubstr("only errors"));
}

TEST(CanTrouble, NoTrafficNamesBusWiringAndBitRate) {
  EXPECT_THAT(explain_can_trouble(working(), silent()),
              AllOf(HasSubstr("nothing is heard on can0 at 250000 bit/s;"), HasSubstr("bit rate")));
}

TEST(CanTrouble, TrafficWithOtherIdentifiersIsToldFromSilence) {
  auto seen = silent();
  seen.other_frames = 1624;
  EXPECT_THAT(explain_can_trouble(working(), seen),
              AllOf(HasSubstr("carries frames"), HasSubstr("0AA, 18FF0100"), HasSubstr("candump can0")));
}

TEST(CanTrouble, LostFramesAreTold) {
  CanObservation seen;
  seen.frames_dropped = 37;
  EXPECT_THAT(explain_can_trouble(working(), seen), AllOf(HasSubstr("37 frames"), HasSubstr("rmem_max")));
}

TEST(CanTrouble, ABusThatCarriesDamagedFramesNamesItsWiring) {
  auto interface = working();
  interface.state = CanControllerState::kPassive;
  EXPECT_THAT(explain_can_trouble(interface, {}),
              AllOf(HasSubstr("error-passive"), HasSubstr("termination")));
}

TEST(CanTrouble, WhereNoBitRateIsSetOneIsProposedAndNoneIsClaimed) {
  auto interface = working();
  interface.bit_rate = 0;
  EXPECT_THAT(explain_can_trouble(interface, silent()), HasSubstr("nothing is heard on can0;"));
  interface.is_up = false;
  EXPECT_THAT(explain_can_trouble(interface, silent()), HasSubstr("up type can bitrate 500000"));
}

TEST(CanInterface, MissingOneIsAnErrorWithARemedy) {
  const auto missing = look_at_can_interface("can77");
  ASSERT_FALSE(missing);
  EXPECT_THAT(missing.error().text(), AllOf(HasSubstr("can77 does not exist"), HasSubstr("plug")));
}

TEST(CanInterface, AnotherKindOfInterfaceIsRefused) {
  const auto loopback = look_at_can_interface("lo");
  ASSERT_FALSE(loopback);
  EXPECT_EQ(loopback.error().kind, ErrorKind::kUsage);
  EXPECT_THAT(loopback.error().what, HasSubstr("lo is not a CAN interface"));
  const auto others = can_interfaces();
  EXPECT_THAT(loopback.error().remedy,
              HasSubstr(others.empty() ? "this PC has no CAN interface" : others.front()));
}

TEST(CanInterface, ImpossibleNamesAreRefused) {
  EXPECT_FALSE(look_at_can_interface(""));
  EXPECT_THAT(look_at_can_interface("a-name-too-long-for-linux").error().what, HasSubstr("no name"));
}

}  // namespace
}  // namespace imuscope
