/// Wheel speeds of a vehicle that has everything that can be chosen: two messages, a multiplexed one,
/// magnitudes with a direction, a fault bit, named and invalid numbers, a counter.

#include "drivers/can_odometry/decoder.h"
#include "drivers/dbc/parser.h"
#include "tests/fuzz/can_frames.h"

namespace imuscope::fuzz {
namespace {

constexpr const char* kVehicle = R"(VERSION ""
BU_: ESP
BO_ 416 WHEELS: 8 ESP
 SG_ RL : 0|16@1+ (0.01,0) [0|655.35] "km/h" ESP
 SG_ RR : 16|16@1+ (0.01,0) [0|655.35] "km/h" ESP
 SG_ Fault : 32|1@1+ (1,0) [0|1] "" ESP
 SG_ Counter : 36|4@1+ (1,0) [0|15] "" ESP
BO_ 417 GEAR: 4 ESP
 SG_ Page M : 0|2@1+ (1,0) [0|3] "" ESP
 SG_ Direction m1 : 8|3@1+ (1,0) [0|7] "" ESP
VAL_ 416 RL 65535 "not available" ;
VAL_ 417 Direction 1 "reverse" 2 "forward" ;
)";

std::unique_ptr<can_odometry::Decoder> vehicle(bool counted) {
  const auto database = dbc::parse(kVehicle, "fuzz.dbc");
  require(database.has_value(), "the vehicle's file can be read");
  can_odometry::Choice choice;
  choice.speed_signals = {"WHEELS.RL", "WHEELS.RR"};
  choice.has_no_sign = true;
  choice.direction_signal = "GEAR.Direction";
  choice.backward_values = {"reverse"};
  choice.fault_signals = {"WHEELS.Fault"};
  choice.invalid_raw = {65534.0};
  if (counted) choice.counter_signal = "WHEELS.Counter";
  auto decoder = can_odometry::Decoder::make(*database, choice, {});
  require(decoder.has_value(), "the choice fits the vehicle");
  return std::move(*decoder);
}

}  // namespace
}  // namespace imuscope::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace imuscope;
  for (const bool counted : {false, true})
    fuzz::decode_frames(*fuzz::vehicle(counted), std::span(data, size));
  return 0;
}
