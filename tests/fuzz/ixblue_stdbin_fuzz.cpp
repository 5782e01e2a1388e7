#include "drivers/ixblue_stdbin/decoder.h"
#include "drivers/ixblue_stdbin/session.h"
#include "tests/fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace imuscope;
  const std::span stream(data, size);
  ixblue_stdbin::Decoder decoder({});
  fuzz::decode(decoder, stream);
  ixblue_stdbin::Session session;
  fuzz::converse(session, stream);
  return 0;
}
