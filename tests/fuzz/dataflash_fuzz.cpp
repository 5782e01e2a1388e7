#include "tests/fuzz/message_log.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  imuscope::fuzz::read_message_log(data, size, imuscope::Protocol::kDataflash);
  return 0;
}
