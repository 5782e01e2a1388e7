#include "service/intake/protocol_finder.h"

#include <algorithm>
#include <tuple>
#include <vector>

#include "service/pipeline/device_factory.h"

namespace imuscope {
namespace {

/// A false frame passes an 8-bit sum now and then: messages must make up this much of a stream.
constexpr double kShareToBelieve = 0.5;

/// Counts what a device is there for, rates and forces or positions, and keeps the steps between their times.
class Counter final : public SampleSink {
 public:
  explicit Counter(SampleKind kind) : kind_(kind) {}
  void on_sample(const Sample& sample) noexcept override {
    if (sample.kind != kind_) return;
    if (count > 0 && sample.time > last_) steps_.push_back(to_seconds(sample.time - last_));
    last_ = sample.time;
    ++count;
  }
  /// From the median step: gaps do not count.
  [[nodiscard]] std::optional<double> rate_hz() {
    if (steps_.empty()) return std::nullopt;
    const auto middle = steps_.begin() + static_cast<std::ptrdiff_t>(steps_.size() / 2);
    std::nth_element(steps_.begin(), middle, steps_.end());
    return 1.0 / *middle;
  }
  std::uint64_t count = 0;

 private:
  SampleKind kind_;
  HostTime last_{};
  std::vector<double> steps_;
};

FoundStream decode_as(const ProtocolTraits& as, std::span<const std::uint8_t> bytes) {
  DeviceConfig device;
  device.protocol = as.protocol;
  device.rate_hz = 100.0;
  const auto decoder = make_decoder(device, 0, ClockMapConfig::fixed(HostTime{}, 1.0));
  Counter counter(as.purpose);
  decoder->push(bytes, HostTime{}, counter);
  decoder->finish(HostTime{}, counter);
  const DecoderCounters& counters = decoder->counters();
  const std::uint64_t covered = bytes.size() - std::min<std::uint64_t>(counters.bytes_skipped, bytes.size());
  return {as.protocol, counters.frames, counter.count,
          bytes.empty() ? 0.0 : static_cast<double>(covered) / static_cast<double>(bytes.size()),
          as.protocol == Protocol::kXsensMt ? std::nullopt : counter.rate_hz()};
}

}  // namespace

std::optional<FoundStream> find_protocol(std::span<const std::uint8_t> bytes) {
  std::optional<FoundStream> best;
  const auto rank = [](const FoundStream& found) { return std::tuple(found.samples > 0, found.share); };
  for (const ProtocolTraits& protocol : kProtocols) {
    if (!protocol.is_stream) continue;
    const FoundStream found = decode_as(protocol, bytes);
    if (found.messages < kMessagesToBelieve || found.share < kShareToBelieve) continue;
    if (!best || rank(found) > rank(*best)) best = found;
  }
  return best;
}

}  // namespace imuscope
