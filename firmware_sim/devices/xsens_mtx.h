#pragma once

/// Firmware of an XSens MTx on a serial line: states, settings and commands as the manuals MT0100P and
/// MT0101P describe them, and legacy MTData out of it. Factory settings: 100 Hz, quaternion and sample
/// counter, 115200 baud.

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "firmware_sim/devices/xsens_encoder.h"
#include "firmware_sim/devices/xsens_unit.h"

namespace imusim {

class XsensMtx final : public XsensUnit {
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

  /// Just powered on, at time power_on_s.
  XsensMtx(const Options& options, Sampler sampler, double power_on_s);

  void jump_clock(double by_s) override;
  bool leave_out(const std::vector<std::string>& blocks) override { return blocks.empty(); }
  [[nodiscard]] int baud() const override { return baud_; }

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

  [[nodiscard]] bool is_addressed(const Command& command) const override { return command.is_for(1); }
  void acknowledge(const Command& command, double t_s) override;
  bool handle_measuring(const Command& command, double t_s) override;
  void restart() override { baud_ = xsens::baud_of_code(settings_.baud_code); }
  void count_anew() override { counter_offset_ = -next_index_; }
  void handle_in_config(const Command& command, double t_s) override;
  template <typename T>
  void request_or_set(const Command& command, T& setting, bool (*is_valid)(T), std::uint8_t error,
                      double t_s);
  void set_period(const Command& command, double t_s);
  void set_baudrate(const Command& command, double t_s);
  void set_sync(const Command& command, std::array<std::uint32_t, 4>& sync, std::size_t parameters,
                double t_s);
  void reply(std::uint8_t mid, const Bytes& data, double t_s);
  void error(std::uint8_t code, double t_s);
  void emit_samples_until(double t_s, std::vector<Emission>& out) override;
  [[nodiscard]] Bytes configuration() const override;
  [[nodiscard]] std::uint16_t data_length() const;
  [[nodiscard]] Bytes data_frame(std::int64_t index);
  [[nodiscard]] bool line_is_free(double ready_s, std::size_t bytes);

  Options options_;
  Sampler sampler_;
  Settings settings_;
  int baud_;
  std::int64_t counter_offset_;  ///< the wire's counter is the index plus this
  double line_busy_until_s_ = -1e300;
};

}  // namespace imusim
