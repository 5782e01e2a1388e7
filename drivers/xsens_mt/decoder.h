#pragma once

/// Samples out of an XSens MT byte stream: legacy MTData of an MTx or MTi, of several MTx behind an Xbus
/// Master, and MTData2.
///
/// Legacy data does not say what it holds. The decoder takes the layout it is given, until a Configuration
/// message in the stream names the real one (a session asks for it before every measurement).
///
/// Time: the sample counter (MTData, period of the configuration) or SampleTimeFine (MTData2) through the
/// clock map; the first byte of a frame is back-dated by the bytes that followed it in its read.

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "drivers/device/device.h"
#include "drivers/xsens_mt/messages.h"
#include "drivers/xsens_mt/mtdata.h"
#include "drivers/xsens_mt/mtdata2.h"
#include "drivers/xsens_mt/scanner.h"
#include "drivers/xsens_mt/unwrap.h"
#include "sample/clock_map.h"

namespace imuscope::xsens {

/// Calibrated rates, forces and field with the sample counter: known to every firmware.
inline constexpr DataLayout kDefaultLayout{output_mode::kCalibrated, output_settings::kSampleCounter};

struct MtDecoderConfig {
  DeviceIndex device = 0;
  /// Behind an Xbus Master: the devices in the order of their bus ids. Empty: `device` is the only one.
  std::vector<DeviceIndex> bus_devices;
  DataLayout layout = kDefaultLayout;                     ///< expected; a Configuration message overrules it
  double rate_hz = 100.0;                                 ///< expected; a Configuration message overrules it
  double baud = 115200.0;                                 ///< of the line; 0 where there is none
  std::array<double, 9> axes{1, 0, 0, 0, 1, 0, 0, 0, 1};  ///< rotates the sensor's components, row-major
  ClockMapConfig clock;
};

class MtDecoder final : public DeviceDecoder {
 public:
  explicit MtDecoder(const MtDecoderConfig& config);

  void push(std::span<const std::uint8_t> bytes, HostTime arrival, SampleSink& sink) noexcept override;
  void finish(HostTime arrival, SampleSink& sink) noexcept override;
  [[nodiscard]] const DecoderCounters& counters() const noexcept override { return counters_; }

  /// Code of the last Error message, if one came.
  [[nodiscard]] std::optional<std::uint8_t> last_error() const noexcept { return last_error_; }
  [[nodiscard]] const ClockMap& clock() const noexcept { return clock_; }

 private:
  /// What one device's block in MTData holds.
  struct Block {
    DataLayout layout;
    std::size_t length = 0;
    DeviceIndex device = 0;
    bool wanted = false;
    std::uint64_t sequence = 0;
    std::uint64_t fingerprint = 0;  ///< of the last data, to notice a device that fell off the bus
    int repeats = 0;
  };
  /// What MTData2 items of one message said.
  struct Inertial {
    std::optional<std::array<double, 3>> acceleration, rate, delta_v;
    std::optional<std::array<double, 4>> delta_q;
    std::optional<std::uint32_t> sample_time_fine;
    std::optional<std::uint16_t> packet_counter;
    std::optional<std::int64_t> utc_ns;
    std::uint32_t status_word = 0;
  };
  /// Where in time a message is.
  struct Instant {
    HostTime time;
    HostTime arrival;
    std::int64_t counter;
    bool gap_before;
  };

  void drain(HostTime arrival, SampleSink& sink, bool at_end) noexcept;
  void on_frame(const Frame& frame, HostTime arrival, SampleSink& sink) noexcept;
  void learn(const Configuration& configuration) noexcept;
  void on_mtdata(const Frame& frame, HostTime arrival, SampleSink& sink) noexcept;
  [[nodiscard]] std::optional<std::uint16_t> counter_of(const Frame& frame) noexcept;
  void emit_block(Block& block, std::span<const std::uint8_t> data, const Instant& at,
                  SampleSink& sink) noexcept;
  [[nodiscard]] static bool is_repeated(Block& block, std::span<const std::uint8_t> data) noexcept;
  [[nodiscard]] std::optional<Instant> instant_of_counter(std::optional<std::uint16_t> counter,
                                                          const Frame& frame, HostTime arrival) noexcept;

  void on_mtdata2(const Frame& frame, HostTime arrival, SampleSink& sink) noexcept;
  [[nodiscard]] static bool read_items(std::span<const std::uint8_t> data, Inertial& out) noexcept;
  [[nodiscard]] bool count_message(const Inertial& message, HostTime first_byte) noexcept;
  [[nodiscard]] bool advance_sample_time(const Inertial& message, HostTime first_byte) noexcept;
  void fill_imu(const Inertial& message, double dt_s, ImuData& imu) const noexcept;

  void restart_clock() noexcept;
  [[nodiscard]] HostTime map(std::int64_t device_time_ns, const Frame& frame) noexcept;
  [[nodiscard]] HostTime arrival_of(const Frame& frame, HostTime time, HostTime arrival) const noexcept;
  [[nodiscard]] Vector3 rotated(const std::array<double, 3>& v) const noexcept;
  void put(Sample& sample, Block& block, const Instant& at, SampleSink& sink) noexcept;

  std::array<double, 9> axes_;
  Duration per_byte_;
  Scanner scanner_;
  ClockMap clock_;
  DecoderCounters counters_;
  std::optional<std::uint8_t> last_error_;

  // Legacy data.
  std::array<Block, kBusDevicesMax> blocks_{};
  std::size_t n_blocks_ = 1;
  bool xbus_ = false;  ///< a counter of the Xbus head leads the blocks
  std::int64_t counts_per_message_ = 1;
  double count_period_s_;
  CountUnwrapper counter_;
  std::uint16_t uncounted_ = 0;  ///< stands in where the layout has no counter
  std::int64_t base_count_ = 0;  ///< device time runs from here at the present period
  std::int64_t base_time_ns_ = 0;

  // MTData2.
  double rate_hz_;
  CountUnwrapper packet_counter_;
  CountUnwrapper sample_time_;
  std::int64_t lost_messages_ = 0;  ///< since the last inertial sample
  std::int64_t sample_count_ = 0;
  std::int64_t last_sample_time_ = 0;  ///< SampleTimeFine of the last inertial sample, unwrapped
  std::int64_t last_step_ticks_ = 0;
  bool has_sample_ = false;
  bool gap_pending_ = false;
};

}  // namespace imuscope::xsens
