#pragma once

/// Pulses of a PPS device of the kernel to kPulse samples, and how the PC steers its clock to kSteering ones.
/// There is no wire: the bytes are pulse_record.h's, which the transport makes of what the kernel says.

#include "drivers/device/device.h"
#include "drivers/device/pulse_record.h"

namespace imuscope::pps {

struct DecoderConfig {
  DeviceIndex device = 0;
};

class Decoder final : public DeviceDecoder {
 public:
  explicit Decoder(const DecoderConfig& config) noexcept : device_(config.device) {}

  void push(std::span<const std::uint8_t> bytes, Arrival arrival, SampleSink& sink) noexcept override;
  [[nodiscard]] const DecoderCounters& counters() const noexcept override { return counters_; }

 private:
  void on_steering(const ClockSteering& steering, HostTime read, SampleSink& sink) noexcept;
  void on_pulse(const UtcPulse& pulse, HostTime read, SampleSink& sink) noexcept;

  DeviceIndex device_;
  DecoderCounters counters_;
  bool has_last_ = false;
  std::uint32_t last_sequence_ = 0;
  HostTime last_time_{};
};

}  // namespace imuscope::pps
