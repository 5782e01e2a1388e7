#pragma once

/// Frames to samples.

#include <array>

#include "drivers/device/device.h"
#include "drivers/throwaway/scanner.h"
#include "sample/clock_map.h"

namespace imuscope::throwaway {

struct DecoderConfig {
  DeviceIndex device = 0;
  Duration period{};  ///< of the sample counter
  std::array<double, 9> axes{1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
  Duration per_byte{};
  ClockMapConfig clock{};
};

class Decoder final : public DeviceDecoder {
 public:
  explicit Decoder(const DecoderConfig& config) noexcept
      : config_(config), scanner_(config.per_byte), clock_(config.clock) {}

  void push(std::span<const std::uint8_t> bytes, Arrival arrival, SampleSink& sink) noexcept override;
  [[nodiscard]] const DecoderCounters& counters() const noexcept override { return counters_; }
  void set_per_byte(Duration per_byte) noexcept override { scanner_.set_per_byte(per_byte); }
  [[nodiscard]] Duration per_byte() const noexcept override { return scanner_.per_byte(); }
  [[nodiscard]] double clock_drift_ppm() const noexcept override { return clock_.drift_ppm(); }
  [[nodiscard]] double clock_sd_s() const noexcept override { return clock_.scatter_s(); }

 private:
  void on_frame(const Frame& frame, HostTime arrival, SampleSink& sink) noexcept;
  [[nodiscard]] Vector3 turned(std::span<const std::uint8_t> bytes, std::size_t offset) const noexcept;

  DecoderConfig config_;
  Scanner scanner_;
  ClockMap clock_;
  DecoderCounters counters_;
  std::int64_t counter_ = -1;  ///< of the last sample, unwrapped
};

}  // namespace imuscope::throwaway
