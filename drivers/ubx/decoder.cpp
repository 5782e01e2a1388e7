#include "drivers/ubx/decoder.h"

#include "drivers/device/feed.h"

namespace imuscope::ubx {

Decoder::Decoder(const DecoderConfig& config) noexcept
    : config_(config), scanner_(config.per_byte), clock_(config.clock) {}

void Decoder::push(std::span<const std::uint8_t> bytes, Arrival arrival, SampleSink& sink) noexcept {
  counters_.bytes += bytes.size();
  feed(scanner_, bytes, arrival.received, [&] { drain(arrival.read, sink, false); });
}

void Decoder::finish(HostTime arrival, SampleSink& sink) noexcept { drain(arrival, sink, true); }

void Decoder::drain(HostTime arrival, SampleSink& sink, bool at_end) noexcept {
  Frame frame;
  while (scanner_.next(frame, at_end)) {
    ++counters_.frames;
    if (frame.kind != Frame::Kind::kMessage) continue;
    if (frame.message_class == kClassNav && frame.id == kIdPvt) on_pvt(frame, arrival, sink);
  }
  counters_.bytes_skipped = scanner_.counters().bytes_skipped;
  counters_.bad_checksums = scanner_.counters().bad_checksums;
  counters_.bad_lengths = scanner_.counters().bad_lengths;
  counters_.bad_contents = bad_messages_;
  counters_.clock_resets = clock_.restarts();
}

void Decoder::on_pvt(const Frame& frame, HostTime arrival, SampleSink& sink) noexcept {
  if (frame.payload.size() < kPvtMin) {
    ++bad_messages_;
    return;
  }
  const NavPvt pvt = parse_nav_pvt(frame.payload);
  if (!time_.take(pvt.itow)) {
    ++bad_messages_;
    return;
  }
  counters_.samples_lost += time_.missing(config_.period);
  Sample sample{};
  sample.kind = SampleKind::kGnss;
  sample.device = config_.device;
  sample.time = clock_.observe(time_.time_ns(), frame.first_byte);
  const auto wire_time = scanner_.per_byte() * static_cast<std::int64_t>(frame.bytes.size());
  sample.arrival = clock_.is_fixed() ? sample.time + wire_time : arrival;
  if (const auto utc = utc_of(pvt)) {
    sample.has_utc = true;
    sample.utc = *utc;
  }
  sample.gnss = gnss_of(pvt);
  sample.sequence = sequence_++;
  ++counters_.samples;
  sink.on_sample(sample);
}

}  // namespace imuscope::ubx
