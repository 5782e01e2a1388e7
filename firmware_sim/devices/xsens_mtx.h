#pragma once

/// Firmware of an XSens MTx on a serial line: states, settings and commands as the manuals MT0100P and
/// MT0101P describe them, and legacy MTData out of it.
///
/// At power-on it sends WakeUp; without a WakeUpAck within 500 ms it sends its Configuration and measures
/// with its stored settings (factory: 100 Hz, quaternion and sample counter, 115200 baud). In Measurement it
/// hears GoToConfig and Reset only, and goes on sending data until it has acknowledged.

#include <array>
#include <cstdint>
#include <deque>
#include <functional>
#include <vector>

#include "firmware_sim/devices/device.h"
#include "firmware_sim/devices/sample_grid.h"
#include "firmware_sim/devices/xsens_command.h"
#include "firmware_sim/devices/xsens_encoder.h"

namespace imusim {

class XsensMtx : public Device {
 public:
  /// What a sample taken at a time holds, but for its counter.
  /// @param counter  counts samples from the first one on, not wrapped
  using Sampler = std::function<xsens::MtSample(double t_s, std::int64_t counter)>;

  struct Options {
    std::uint32_t device_id = 0x00300001;
    double latency_s = 0.002;     ///< from the sampling instant to the first bit of the message
    double clock_skew_ppm = 0.0;  ///< positive: the device's clock is fast, so it samples more often
    double first_sample_s = 0.0;  ///< earliest sampling instant
    std::uint16_t first_counter = 0;
    std::uint16_t period = 1152;  ///< stored period, 1/115200 s
    int baud = 115200;
    bool sends_temperature = false;  ///< where it measures without having been told what
  };

  enum class State { kOff, kWaking, kConfig, kMeasurement };

  /// Just powered on, at time power_on_s.
  XsensMtx(const Options& options, Sampler sampler, double power_on_s);

  void receive(std::span<const std::uint8_t> bytes, double t_s) override;
  void run_until(double t_s, std::vector<Emission>& out) override;
  void power_cycle(double t_s, double off_s) override;
  void jump_clock(double by_s) override;
  void add_skew(double ppm) override;
  bool leave_out(const std::vector<std::string>& blocks) override { return blocks.empty(); }
  [[nodiscard]] int baud() const override { return baud_; }

  [[nodiscard]] State state() const { return state_; }

  /// Starts measuring calibrated rates and forces with the sample counter in float32, as if a host had just
  /// set it up. The answers to ReqConfiguration and GoToMeasurement lead the data: they say what the data
  /// hold.
  void start_calibrated(double t_s);

 private:
  /// Kept without power.
  struct Settings {
    std::uint16_t period = 1152;  // 1/115200 s
    std::uint16_t skip_factor = 0;
    std::uint16_t output_mode = xsens::kModeOrientation;
    std::uint32_t output_settings = xsens::kSettingsCounter;
    std::uint16_t error_mode = 1;
    std::uint8_t baud_code = 2;
    std::array<std::uint32_t, 4> sync_in{};   // mode, skip, offset
    std::array<std::uint32_t, 4> sync_out{};  // mode, skip, offset, pulse width
    std::uint16_t transmit_delay = 0;
  };
  using Command = xsens::Command;

  void handle(const Command& command, double t_s);
  void handle_in_config(const Command& command, double t_s);
  template <typename T>
  void request_or_set(const Command& command, T& setting, bool (*is_valid)(T), std::uint8_t error,
                      double t_s);
  void set_period(const Command& command, double t_s);
  void set_baudrate(const Command& command, double t_s);
  void set_sync(const Command& command, std::array<std::uint32_t, 4>& sync, std::size_t parameters,
                double t_s);
  void power_on(double t_s);
  void enter_measurement(double t_s);
  void reply(std::uint8_t mid, const Bytes& data, double t_s);
  void error(std::uint8_t code, double t_s);
  void emit_samples_until(double t_s, std::vector<Emission>& out);
  [[nodiscard]] Bytes configuration() const;
  [[nodiscard]] std::uint16_t data_length() const;
  [[nodiscard]] Bytes data_frame(std::int64_t index);
  [[nodiscard]] bool line_is_free(double ready_s, std::size_t bytes);

  Options options_;
  Sampler sampler_;
  Settings settings_;
  State state_ = State::kWaking;
  int baud_;
  double wake_deadline_s_ = 0.0;
  double power_on_s_ = 0.0;  ///< when it wakes, while it is off
  /// Measurement ends when the ack of GoToConfig leaves; infinite when none is due.
  double measurement_end_s_;
  xsens::CommandScanner scanner_;
  std::deque<Emission> replies_;
  SampleGrid grid_;
  std::int64_t next_index_ = 0;
  std::int64_t counter_offset_;  ///< the wire's counter is the index plus this
  double line_busy_until_s_ = -1e300;
};

}  // namespace imusim
