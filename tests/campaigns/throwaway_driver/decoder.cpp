#include "drivers/throwaway/decoder.h"

#include <bit>

#include "base/bytes.h"
#include "drivers/device/feed.h"

namespace imuscope::throwaway {

void Decoder::push(std::span<const std::uint8_t> bytes, Arrival arrival, SampleSink& sink) noexcept {
  counters_.bytes += bytes.size();
  feed(scanner_, bytes, arrival.received, [&] {
    Frame frame;
    while (scanner_.next(frame)) on_frame(frame, arrival.read, sink);
  });
  counters_.bytes_skipped = scanner_.counters().bytes_skipped;
  counters_.bad_checksums = scanner_.counters().bad_checksums;
  counters_.clock_resets = clock_.restarts();
}

void Decoder::on_frame(const Frame& frame, HostTime arrival, SampleSink& sink) noexcept {
  ++counters_.frames;
  const auto counter = read_le<std::uint16_t>(frame.bytes, kCounterAt);
  const auto step = static_cast<std::uint16_t>(counter - static_cast<std::uint16_t>(counter_));
  const bool is_first = counter_ < 0;
  counter_ = is_first ? counter : counter_ + step;

  Sample sample{};
  sample.kind = SampleKind::kImu;
  sample.device = config_.device;
  sample.sequence = counters_.samples++;
  sample.time = clock_.observe(counter_ * config_.period.count(), frame.first_byte);
  const auto wire_time = scanner_.per_byte() * static_cast<std::int64_t>(kFrameSize);
  sample.arrival = clock_.is_fixed() ? sample.time + wire_time : arrival;
  sample.imu = ImuData{};
  sample.imu.omega_radps = turned(frame.bytes, kRateAt);
  sample.imu.f_mps2 = turned(frame.bytes, kForceAt);
  sample.imu.counter = counter_;
  sample.imu.flags = kGyroValid | kAccelValid;
  if (!is_first && step > 1) {
    sample.imu.flags |= kGapBefore;
    counters_.samples_lost += step - 1U;
  }
  sink.on_sample(sample);
}

Vector3 Decoder::turned(std::span<const std::uint8_t> bytes, std::size_t offset) const noexcept {
  Vector3 out{};
  for (std::size_t k = 0; k < 3; ++k) {
    const double value = std::bit_cast<float>(read_le<std::uint32_t>(bytes, offset + 4 * k));
    for (std::size_t i = 0; i < 3; ++i) out[i] += config_.axes[3 * i + k] * value;
  }
  return out;
}

}  // namespace imuscope::throwaway
