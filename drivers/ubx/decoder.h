#pragma once

/// u-blox receivers: NAV-PVT to one kGnss sample each. Device time is iTOW, the navigation epoch; UTC is that
/// of the message, second plus (signed) nanoseconds.

#include <cstdint>

#include "drivers/device/device.h"
#include "drivers/ubx/messages.h"
#include "drivers/ubx/scanner.h"
#include "sample/clock_map.h"

namespace imuscope::ubx {

/// What the decoder is told of receiver and line: a message tells neither its rate nor the line's.
struct DecoderConfig {
  DeviceIndex device = 0;
  /// Time between epochs, to tell missing ones; zero: not looked for.
  Duration period{};
  /// Time of one byte on the serial line, see byte_time(); zero over a network.
  Duration per_byte{};
  ClockMapConfig clock{};
};

class Decoder final : public DeviceDecoder {
 public:
  explicit Decoder(const DecoderConfig& config) noexcept;

  void push(std::span<const std::uint8_t> bytes, Arrival arrival, SampleSink& sink) noexcept override;
  void finish(HostTime arrival, SampleSink& sink) noexcept override;
  [[nodiscard]] const DecoderCounters& counters() const noexcept override { return counters_; }
  void set_per_byte(Duration per_byte) noexcept override { scanner_.set_per_byte(per_byte); }
  [[nodiscard]] Duration per_byte() const noexcept override { return scanner_.per_byte(); }
  [[nodiscard]] double clock_drift_ppm() const noexcept override { return clock_.drift_ppm(); }
  [[nodiscard]] double clock_sd_s() const noexcept override { return clock_.scatter_s(); }

 private:
  void drain(HostTime arrival, SampleSink& sink, bool at_end) noexcept;
  void on_pvt(const Frame& frame, HostTime arrival, SampleSink& sink) noexcept;

  DecoderConfig config_;
  Scanner scanner_;
  ClockMap clock_;
  DecoderCounters counters_;
  std::uint64_t bad_messages_ = 0;
  std::uint64_t sequence_ = 0;
  WeekTime time_;
};

}  // namespace imuscope::ubx
