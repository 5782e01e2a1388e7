#pragma once

/// Frames of wire.h to samples: sensor_msgs/Imu, NavSatFix, TimeReference and the speed of nav_msgs/Odometry.
/// Times must not go back. Core: no allocation after construction.

#include <optional>

#include "drivers/device/device.h"
#include "drivers/device/scan_loop.h"
#include "drivers/ros_message/wire.h"
#include "sample/clock_map.h"

namespace imuscope::ros_message {

/// How the messages of one device are taken.
struct DecoderConfig {
  DeviceIndex device = 0;
  /// Row-major rotation of the message's axes to the device's (b, or s).
  std::array<double, 9> axes{1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
  Duration period{};           ///< nominal, to tell gaps; zero: none are told
  bool times_are_utc = false;  ///< samples carry their time as UTC, too
  ClockMapConfig clock = ClockMapConfig::fixed({}, 1.0);
};

class Decoder final : public DeviceDecoder {
 public:
  explicit Decoder(const DecoderConfig& config) noexcept : config_(config), clock_(config.clock) {}

  void push(std::span<const std::uint8_t> bytes, Arrival arrival, SampleSink& sink) noexcept override;
  void finish(HostTime arrival, SampleSink& sink) noexcept override { drain(arrival, sink, true); }
  [[nodiscard]] const DecoderCounters& counters() const noexcept override { return counters_; }
  [[nodiscard]] std::string_view remark() const noexcept override;
  [[nodiscard]] double clock_drift_ppm() const noexcept override { return clock_.drift_ppm(); }
  [[nodiscard]] double clock_sd_s() const noexcept override { return clock_.scatter_s(); }

 private:
  void drain(HostTime arrival, SampleSink& sink, bool at_end) noexcept;
  bool take(const Content& content, HostTime first_byte, HostTime arrival, SampleSink& sink) noexcept;
  bool fill(const Content& content, std::uint64_t missing, Sample& sample) const noexcept;

  DecoderConfig config_;
  ScanLoop<2 * kFrameMost> loop_{Duration::zero()};
  ClockMap clock_;
  DecoderCounters counters_;
  std::optional<std::int64_t> last_time_ns_;
  std::uint64_t sequence_ = 0;
  std::uint64_t went_back_ = 0;
};

}  // namespace imuscope::ros_message
