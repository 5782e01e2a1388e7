#pragma once

/// Samples out of an XSens MT byte stream: legacy MTData of an MTx or MTi, of several MTx behind an Xbus
/// Master, and MTData2.
///
/// Rates and forces become kImu samples. Where they are wanted, the device's own orientation becomes
/// kAttitude (its roll and pitch; its heading is not marked valid), and the solution of a receiver inside
/// becomes kGnss.
///
/// Legacy data does not say what it holds. The decoder takes the layout it is given, until a Configuration
/// message in the stream names the real one (a session asks for it before every measurement).
///
/// What the device's own count misses is lost, but for the pause that begins with its acknowledgement of
/// GoToConfig.
///
/// Time: the sample counter (MTData, period of the configuration) or SampleTimeFine (MTData2) through the
/// clock map; the first byte of a frame is back-dated by the bytes that followed it in its read.

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "drivers/device/attitude_angles.h"
#include "drivers/device/device.h"
#include "drivers/device/nav_pvt.h"
#include "drivers/xsens_mt/inertial.h"
#include "drivers/xsens_mt/messages.h"
#include "drivers/xsens_mt/mtdata.h"
#include "drivers/xsens_mt/mtdata2.h"
#include "drivers/xsens_mt/scanner.h"
#include "drivers/xsens_mt/unwrap.h"
#include "sample/clock_map.h"

namespace imuscope::xsens {

/// Calibrated rates, forces and field with the sample counter: known to every firmware.
inline constexpr DataLayout kDefaultLayout{output_mode::kCalibrated, output_settings::kSampleCounter};

/// A device behind an Xbus Master.
struct BusDevice {
  DeviceIndex device = 0;
  Matrix3 axes{1, 0, 0, 0, 1, 0, 0, 0, 1};
};

/// What is wanted of the device, or of those behind an Xbus Master, and what is expected of the stream until
/// it says otherwise.
struct MtDecoderConfig {
  DeviceIndex device = 0;
  /// Behind an Xbus Master, element k is the device with bus id k + 1, if it is wanted. Empty: `device` is
  /// the only one.
  std::vector<std::optional<BusDevice>> bus;
  bool wants_imu = true;
  bool wants_attitude = false;
  bool wants_gnss = false;
  DataLayout layout = kDefaultLayout;  ///< expected; a Configuration message overrules it
  double rate_hz = 100.0;  ///< expected; Configuration (MTData) or OutputConfiguration (MTData2) overrules it
  Duration per_byte = byte_time(115200.0);  ///< time of one byte on the line; zero where there is none
  Matrix3 axes{1, 0, 0, 0, 1, 0, 0, 0, 1};  ///< rotates the sensor's components
  ClockMapConfig clock;
};

class MtDecoder final : public DeviceDecoder {
 public:
  explicit MtDecoder(const MtDecoderConfig& config);

  void push(std::span<const std::uint8_t> bytes, Arrival arrival, SampleSink& sink) noexcept override;
  void finish(HostTime arrival, SampleSink& sink) noexcept override;
  [[nodiscard]] const DecoderCounters& counters() const noexcept override { return counters_; }

  [[nodiscard]] std::string_view remark() const noexcept override {
    return last_error_ ? error_text(*last_error_) : std::string_view{};
  }

  /// Code of the last Error message, if one came.
  [[nodiscard]] std::optional<std::uint8_t> last_error() const noexcept { return last_error_; }
  [[nodiscard]] const ClockMap& clock() const noexcept { return clock_; }
  void set_per_byte(Duration per_byte) noexcept override { scanner_.set_per_byte(per_byte); }
  [[nodiscard]] Duration per_byte() const noexcept override { return scanner_.per_byte(); }
  [[nodiscard]] double clock_drift_ppm() const noexcept override { return clock_.drift_ppm(); }
  [[nodiscard]] double clock_sd_s() const noexcept override { return clock_.scatter_s(); }

 private:
  /// What one device's block in MTData holds, and whose it is.
  struct Block {
    DataLayout layout;
    std::size_t length = 0;
    DeviceIndex device = 0;
    Matrix3 axes{};
    bool wanted = false;
    std::uint64_t sequence = 0;
    std::uint64_t fingerprint = 0;  ///< of the last data, to notice a device that fell off the bus
    int repeats = 0;
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
  void learn_output(std::span<const std::uint8_t> data) noexcept;
  void on_mtdata(const Frame& frame, HostTime arrival, SampleSink& sink) noexcept;
  [[nodiscard]] std::uint16_t counter_of(const Frame& frame) noexcept;
  [[nodiscard]] bool take_counter(std::uint16_t counter, HostTime first_byte) noexcept;
  void note_gap(std::int64_t samples) noexcept;
  void emit_block(Block& block, std::span<const std::uint8_t> data, const Instant& at,
                  SampleSink& sink) noexcept;
  void emit_legacy_gnss(const MtData& message, const Frame& frame, HostTime arrival,
                        SampleSink& sink) noexcept;
  [[nodiscard]] static bool is_repeated(Block& block, std::span<const std::uint8_t> data) noexcept;

  void on_mtdata2(const Frame& frame, HostTime arrival, SampleSink& sink) noexcept;
  [[nodiscard]] bool count_message(HostTime first_byte) noexcept;
  [[nodiscard]] bool advance_sample_time(HostTime first_byte) noexcept;
  [[nodiscard]] std::int64_t device_time_ns() const noexcept;
  void emit_inertial(const Instant& at, SampleSink& sink) noexcept;
  void fill_imu(ImuData& imu) const noexcept;
  void fill_increments(ImuData& imu) const noexcept;

  void emit_attitude(Block& block, const Matrix3& C_s_l, LocalFrame local, bool filter_valid,
                     const Sample& like, SampleSink& sink) noexcept;
  void emit_gnss(const NavPvt& pvt, const Frame& frame, HostTime arrival, SampleSink& sink) noexcept;
  void restart_clock() noexcept;
  [[nodiscard]] HostTime arrival_of(const Frame& frame, HostTime time, HostTime arrival) const noexcept;
  void put(Sample& sample, Block& block, SampleSink& sink) noexcept;

  bool wants_imu_;
  bool wants_attitude_;
  bool wants_gnss_;
  Scanner scanner_;
  ClockMap clock_;
  DecoderCounters counters_;
  std::uint64_t restarts_ = 0;  ///< segments begun because the count was not continuable
  std::optional<std::uint8_t> last_error_;
  ClockMap gnss_clock_;
  WeekTime gnss_time_;

  // Legacy data.
  std::array<Block, kBusDevicesMax> blocks_{};
  MtData message_;  ///< the block at hand; kept, since clearing it anew costs more than reading one
  std::size_t n_blocks_ = 1;
  std::size_t message_length_ = 0;  ///< of the counter of an Xbus head and all blocks
  bool xbus_ = false;               ///< a counter of the Xbus head leads the blocks
  std::int64_t counts_per_message_ = 1;
  double count_period_s_;
  CountUnwrapper counter_;
  std::uint16_t uncounted_ = 0;  ///< stands in where the layout has no counter
  std::int64_t base_count_ = 0;  ///< device time runs from here at the present period
  std::int64_t base_time_ns_ = 0;

  // MTData2.
  InertialMessage inertial_{};  ///< the message at hand
  double rate_hz_;
  CountUnwrapper packet_counter_;
  CountUnwrapper sample_time_;
  std::int64_t lost_messages_ = 0;  ///< since the last inertial sample
  std::int64_t sample_count_ = 0;
  std::int64_t last_sample_time_ = 0;  ///< SampleTimeFine of the last inertial sample, unwrapped
  std::int64_t last_step_ticks_ = 0;
  bool has_sample_ = false;
  bool gap_pending_ = false;
  bool told_to_pause_ = false;  ///< it acknowledged GoToConfig, and has sent no data since
};

}  // namespace imuscope::xsens
