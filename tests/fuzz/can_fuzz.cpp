#include <string_view>

#include "drivers/device/can_frame.h"
#include "drivers/transport/candump.h"
#include "tests/fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace imuscope;
  CanFrameReader reader(std::span(data, size));
  CanFrame frame;
  std::size_t frames = 0;
  while (reader.next(frame)) {
    ++frames;
    fuzz::require(frame.payload().size() <= kCanMaxData, "a frame holds at most 64 bytes");
  }
  fuzz::require(frames * kCanRecordHeaderBytes + reader.bytes_skipped() <= size, "records do not overlap");
  std::string_view text(reinterpret_cast<const char*>(data), size);
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const CandumpLine line = read_candump_line(text.substr(0, end));
    fuzz::require(line.frame.frame.payload().size() <= kCanMaxData, "a frame holds at most 64 bytes");
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return 0;
}
