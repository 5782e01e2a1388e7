#include "drivers/greis/decoder.h"
#include "drivers/greis/session.h"
#include "tests/fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace imuscope;
  const std::span stream(data, size);
  greis::Decoder decoder({});
  fuzz::decode(decoder, stream);
  greis::Session session({});
  fuzz::converse(session, stream);
  return 0;
}
