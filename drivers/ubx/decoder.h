#pragma once

/// u-blox receivers: NAV-PVT to one kGnss sample each.
///
/// Standard deviations: hAcc is of the plane, so each of north and east gets 1/sqrt(2) of it; sAcc is of the
/// whole velocity vector, each axis gets 1/sqrt(3). Device time is iTOW, the navigation epoch; UTC is that of
/// the message, second plus (signed) nanoseconds.

#include <cstdint>
#include <optional>

#include "drivers/device/device.h"
#include "drivers/ubx/messages.h"
#include "drivers/ubx/scanner.h"
#include "sample/clock_map.h"

namespace imuscope::ubx {

struct DecoderConfig {
  DeviceIndex device = 0;
  /// Time between epochs, to tell missing ones; zero: not looked for.
  Duration period{};
  /// Of the serial line; 0 over a network.
  double baud = 0.0;
  ClockMapConfig clock{};
};

class Decoder final : public DeviceDecoder {
 public:
  explicit Decoder(const DecoderConfig& config) noexcept;

  void push(std::span<const std::uint8_t> bytes, HostTime arrival, SampleSink& sink) noexcept override;
  void finish(HostTime arrival, SampleSink& sink) noexcept override;
  [[nodiscard]] const DecoderCounters& counters() const noexcept override { return counters_; }

 private:
  void drain(HostTime arrival, SampleSink& sink, bool at_end) noexcept;
  void on_pvt(const Frame& frame, HostTime arrival, SampleSink& sink) noexcept;
  [[nodiscard]] bool unwrap_time(std::uint32_t itow_ms) noexcept;

  DecoderConfig config_;
  Scanner scanner_;
  ClockMap clock_;
  DecoderCounters counters_;
  std::uint64_t bad_messages_ = 0;
  std::uint64_t sequence_ = 0;
  std::optional<std::uint32_t> last_itow_ms_;
  std::int64_t time_ms_ = 0;  ///< iTOW, unwrapped through the week
};

}  // namespace imuscope::ubx
