#include "drivers/ros_message/decoder.h"
#include "tests/fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace imuscope;
  ros_message::Decoder decoder({});
  fuzz::decode(decoder, std::span(data, size));
  return 0;
}
