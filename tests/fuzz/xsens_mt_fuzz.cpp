#include "drivers/xsens_mt/decoder.h"
#include "drivers/xsens_mt/session.h"
#include "tests/fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace imuscope;
  const std::span stream(data, size);
  xsens::MtDecoder decoder({});
  fuzz::decode(decoder, stream);
  xsens::MtDecoderConfig bus;
  bus.bus = {xsens::BusDevice{0}, xsens::BusDevice{1}, xsens::BusDevice{2}};
  xsens::MtDecoder bus_decoder(bus);
  fuzz::decode(bus_decoder, stream);
  xsens::MtSession session({});
  fuzz::converse(session, stream);
  xsens::MtSessionConfig head;
  head.bus_devices = 3;
  xsens::MtSession head_session(head);
  fuzz::converse(head_session, stream);
  return 0;
}
