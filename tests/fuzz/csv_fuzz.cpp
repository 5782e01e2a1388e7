#include "drivers/csv/decoder.h"
#include "tests/fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace imuscope;
  csv::ImuDecoder imu({});
  fuzz::decode(imu, std::span(data, size));
  csv::GnssDecoder gnss({});
  fuzz::decode(gnss, std::span(data, size));
  return 0;
}
