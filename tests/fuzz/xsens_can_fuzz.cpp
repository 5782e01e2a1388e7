#include "drivers/xsens_can/decoder.h"
#include "tests/fuzz/can_frames.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace imuscope;
  const std::span stream(data, size);
  xsens_can::Decoder of_frames({});
  fuzz::decode_frames(of_frames, stream);
  xsens_can::Decoder of_bytes({});
  fuzz::decode(of_bytes, stream);
  return 0;
}
