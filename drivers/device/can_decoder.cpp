#include "drivers/device/can_decoder.h"

namespace imuscope {

void CanDecoder::push(std::span<const std::uint8_t> bytes, Arrival arrival, SampleSink& sink) noexcept {
  counters_.bytes += bytes.size();
  CanFrameReader reader(bytes);
  CanFrame frame;
  while (reader.next(frame)) {
    if (frame.is_error || frame.is_remote) continue;
    ++counters_.frames;
    on_frame(frame, arrival.read, sink);
  }
  counters_.bytes_skipped += reader.bytes_skipped();
}

}  // namespace imuscope
