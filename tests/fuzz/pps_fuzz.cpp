#include "drivers/pps/decoder.h"
#include "tests/fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace imuscope;
  pps::Decoder decoder({});
  fuzz::decode(decoder, std::span(data, size));
  return 0;
}
