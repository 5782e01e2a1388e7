#include "drivers/pps/decoder.h"

#include <algorithm>

namespace imuscope::pps {

namespace {

/// A reader that lost the processor between the two clocks does not know when the pulse came.
constexpr Duration kApartMax = std::chrono::microseconds(100);
/// The kernel keeps the newest pulse alone, and it is looked for many times a second.
constexpr Duration kOldest = std::chrono::seconds(5);
/// A count that jumps by more began anew.
constexpr std::uint32_t kLostMax = 1U << 20U;

}  // namespace

void Decoder::push(std::span<const std::uint8_t> bytes, Arrival arrival, SampleSink& sink) noexcept {
  counters_.bytes += bytes.size();
  while (!bytes.empty()) {
    const auto pulse = read_pulse_record(bytes);
    const auto steering = pulse ? std::nullopt : read_steering_record(bytes);
    if (!pulse && !steering) {
      // Reads hold whole records: what is none is a damaged capture's.
      counters_.bytes_skipped += bytes.size();
      return;
    }
    bytes = bytes.subspan(kPulseRecordBytes);
    ++counters_.frames;
    if (pulse) {
      on_pulse(*pulse, arrival.read, sink);
    } else {
      on_steering(*steering, arrival.read, sink);
    }
  }
}

void Decoder::on_steering(const ClockSteering& steering, HostTime read, SampleSink& sink) noexcept {
  if (steering.apart > kApartMax || steering.time > read || read - steering.time > kOldest) {
    ++counters_.bad_contents;
    return;
  }
  Sample sample{};
  sample.kind = SampleKind::kSteering;
  sample.device = device_;
  sample.sequence = counters_.samples++;
  sample.arrival = read;
  sample.time = steering.time;
  sample.steering = {to_ns(steering.unsteered), steering.rate};
  sink.on_sample(sample);
}

void Decoder::on_pulse(const UtcPulse& pulse, HostTime read, SampleSink& sink) noexcept {
  const std::uint32_t step = pulse.sequence - last_sequence_;
  const bool is_again = has_last_ && (step == 0 || pulse.time <= last_time_);
  if (is_again || pulse.apart > kApartMax || pulse.time > read || read - pulse.time > kOldest) {
    ++counters_.bad_contents;
    return;
  }
  if (has_last_ && step > 1) {
    if (step <= kLostMax) {
      counters_.samples_lost += step - 1;
    } else {
      ++counters_.clock_resets;
    }
  }
  has_last_ = true;
  last_sequence_ = pulse.sequence;
  last_time_ = pulse.time;
  Sample sample{};
  sample.kind = SampleKind::kPulse;
  sample.device = device_;
  sample.sequence = counters_.samples++;
  sample.arrival = read;
  sample.time = pulse.time;
  sample.pulse.wall_ns = to_ns(pulse.wall);
  sink.on_sample(sample);
}

}  // namespace imuscope::pps
