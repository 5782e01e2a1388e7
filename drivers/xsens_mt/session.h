#pragma once

/// Brings an XSens MT device (MTx, MTi, Xbus Master) to send what is wanted: listens first and takes over a
/// device that sends exactly that already; else goes to config (skipping data, with retries and a Reset as
/// the last resort), reads the configuration, sets only what differs, checks what the device really took, and
/// starts the measurement. Watches the stream afterwards: a device that restarts (WakeUp) or sends something
/// else is set up again. One that falls silent may only be held up by its line: it is sent GoToMeasurement,
/// which wakes a device that waits in its configuration state and is nothing to one that measures, so that a
/// stall that ends by itself costs no sample; after ten seconds without an answer it is set up again.
/// Settings are kept by the device, so nothing is written that is there already.
///
/// Owns a scanner of its own; does no I/O. Core: no allocation, noexcept.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "drivers/device/device.h"
#include "drivers/xsens_mt/decoder.h"
#include "drivers/xsens_mt/messages.h"
#include "drivers/xsens_mt/scanner.h"

namespace imuscope::xsens {

/// SyncIn input: mode bits 0-1 edge (1 rising, 2 falling, 3 both), 0x4 send the latest on a trigger, 0x10
/// clock synchronisation; offset in 1/29.4912 MHz.
struct SyncIn {
  std::uint16_t mode = 0;
  std::uint16_t skip = 0;
  std::uint32_t offset = 0;
};

/// What the device is to send, and how; the session writes to it only what differs.
struct MtSessionConfig {
  enum class Output : std::uint8_t {
    kAsDevice,  ///< MTData2 where the device's configuration says that it sends it, else legacy
    kLegacy,    ///< MTData
    kMtData2,
  };
  Output output = Output::kAsDevice;
  DataLayout layout = kDefaultLayout;  ///< legacy data of every device on the line
  double rate_hz = 100.0;              ///< messages per second; 115200 / rate must be whole to 0.1 %
  double baud = 115200.0;              ///< to tell beforehand whether the data fits the line
  int stop_bits = 1;
  std::optional<SyncIn> sync_in;
  bool searching_baud = false;             ///< the rate is a guess: give up sooner
  std::optional<std::uint32_t> device_id;  ///< that it must have; asked before its data is taken
  std::size_t bus_devices = 0;             ///< behind an Xbus Master; 0: the device has the line for itself
};

class MtSession final : public DeviceSession {
 public:
  explicit MtSession(const MtSessionConfig& config);

  void on_bytes(std::span<const std::uint8_t> bytes, HostTime now) noexcept override;
  [[nodiscard]] std::span<const std::uint8_t> poll(HostTime now) noexcept override;
  [[nodiscard]] SessionState state() const noexcept override;
  [[nodiscard]] std::string_view problem() const noexcept override {
    return {problem_.data(), problem_size_};
  }

  [[nodiscard]] bool wants_other_baud() const noexcept override { return wants_other_baud_; }

  /// What the device said it is; nothing before it answered.
  [[nodiscard]] std::optional<std::uint32_t> device_id() const noexcept { return device_id_; }
  [[nodiscard]] const std::optional<Configuration>& configuration() const noexcept { return configuration_; }

 private:
  enum class Step : std::uint8_t {
    kListen,
    kGoToConfig,
    kReset,
    kIdentify,
    kLeaveTextMode,
    kReadConfiguration,
    kSetPeriod,
    kSetSkipFactor,
    kSetMode,
    kSetSettings,
    kSetSyncInMode,
    kSetSyncInSkip,
    kSetSyncInOffset,
    kCheckDataLength,
    kCheckConfiguration,
    kSetOutputConfiguration,
    kMeasure,
    kStreaming,
    kSilent,  ///< was streaming
    kFailed,
  };

  [[nodiscard]] static Duration repeat_after(Step step) noexcept;
  void enter(Step step, HostTime now) noexcept;
  void prepare() noexcept;
  void set_request(std::uint8_t bid, std::uint8_t mid, std::span<const std::uint8_t> data = {}) noexcept;
  void on_frame(const Frame& frame, HostTime now) noexcept;
  void on_reply(const Frame& frame, HostTime now) noexcept;
  void on_configuration_read(HostTime now) noexcept;
  void set_output(HostTime now) noexcept;
  [[nodiscard]] bool sync_in_is_wanted() const noexcept;
  void on_configuration_checked(HostTime now) noexcept;
  void on_output_configuration(std::span<const std::uint8_t> data, HostTime now) noexcept;
  void on_data(const Frame& frame, HostTime now) noexcept;
  void on_error(std::uint8_t code, HostTime now) noexcept;
  void on_timeout(HostTime now) noexcept;
  void next_device_or(Step step, HostTime now) noexcept;
  void fail_round(HostTime now) noexcept;
  void refuse_device() noexcept;
  void watch_stream(HostTime now) noexcept;
  [[nodiscard]] bool sends_what_is_wanted(const Configuration& configuration) const noexcept;
  [[nodiscard]] std::optional<std::int64_t> wanted_count(const Frame& frame) const noexcept;
  [[nodiscard]] std::optional<std::int64_t> wanted_bus_count(
      std::span<const std::uint8_t> data) const noexcept;
  void look_for_text(std::span<const std::uint8_t> bytes) noexcept;
  [[nodiscard]] bool takes_over(std::int64_t count, HostTime now) noexcept;
  [[nodiscard]] bool speaks_mtdata2() const noexcept;
  [[nodiscard]] std::uint8_t bid_of_device() const noexcept;
  void say_why_there_is_no_answer() noexcept;
  void say(const char* format, ...) noexcept __attribute__((format(printf, 2, 3)));
  void no_problem() noexcept { problem_size_ = 0; }

  MtSessionConfig config_;
  std::uint16_t period_ = 0;
  std::size_t wanted_length_ = 0;
  Duration listen_for_{};
  Scanner scanner_;

  Step step_ = Step::kListen;
  bool started_ = false;
  HostTime step_since_{};
  HostTime next_send_{};
  int attempts_ = 0;
  int rounds_ = 0;          ///< of configuration that ended badly
  std::size_t device_ = 0;  ///< on the bus, that is being set
  bool to_send_ = false;
  OutgoingFrame request_;
  OutgoingFrame wake_up_ack_{kMasterBid, mid::kWakeUpAck};
  bool acknowledge_wake_up_ = false;
  std::uint8_t awaited_ = 0;  ///< message id of the reply

  std::optional<std::uint32_t> device_id_;
  std::optional<Configuration> configuration_;
  bool legacy_after_refusal_ = false;
  bool sync_in_written_ = false;
  bool wants_other_baud_ = false;

  // What the line did since the step began.
  std::uint64_t bytes_ = 0;
  std::uint64_t frames_ = 0;
  std::uint64_t data_frames_ = 0;
  bool sends_text_ = false;  ///< NMEA instead of messages, as somebody left it
  std::uint8_t last_byte_ = 0;
  // Data that is as wanted, one after the other.
  int wanted_in_a_row_ = 0;
  std::int64_t last_count_ = 0;
  HostTime first_wanted_{};
  HostTime last_wanted_{};
  HostTime last_data_{};

  std::array<char, 240> problem_{};
  std::size_t problem_size_ = 0;
};

}  // namespace imuscope::xsens
