#pragma once

/// Firmware of an MTi of the 10/100 series on a serial line, with MTData2: items with rates of their own, a
/// counter (1020) that counts every message, GNSS positions in messages of their own among them, and a
/// SampleTimeFine that begins anew after a day.
///
/// At power-on it sends WakeUp; without a WakeUpAck within 500 ms it sends its Configuration (which names no
/// legacy data) and measures. In Measurement it hears GoToConfig and Reset only.

#include <cstdint>
#include <deque>
#include <functional>
#include <vector>

#include "firmware_sim/devices/device.h"
#include "firmware_sim/devices/sample_grid.h"
#include "firmware_sim/devices/xsens_command.h"
#include "firmware_sim/devices/xsens_encoder.h"

namespace imusim {

class XsensMti : public Device {
 public:
  /// @param counter  counts samples from the first one on, not wrapped
  using Sampler = std::function<xsens::MtSample(double t_s, std::int64_t counter)>;

  struct Options {
    std::uint32_t device_id = 0x03700001;
    double latency_s = 0.002;
    double clock_skew_ppm = 0.0;
    double first_sample_s = 0.0;
    std::uint16_t first_packet = 0;
    std::uint32_t first_sample_time = 0;  ///< SampleTimeFine of sample 0, 1/10000 s
    bool has_gnss = false;                ///< a position 4 times a second, where it is configured
    int baud = 115200;
  };
  /// An entry of OutputConfiguration.
  struct Output {
    std::uint16_t item;
    std::uint16_t rate_hz;
    bool operator==(const Output&) const = default;
  };

  XsensMti(const Options& options, Sampler sampler, double power_on_s);

  void receive(std::span<const std::uint8_t> bytes, double t_s) override;
  void run_until(double t_s, std::vector<Emission>& out) override;
  void power_cycle(double t_s, double off_s) override;
  void jump_clock(double by_s) override { grid_.jump(by_s); }
  void add_skew(double ppm) override { grid_.set_skew(grid_.skew_ppm() + ppm, next_index_); }
  bool leave_out(const std::vector<std::string>& blocks) override { return blocks.empty(); }
  [[nodiscard]] int baud() const override { return baud_; }

  /// Measures rates, forces, the message counter, SampleTimeFine and status word at `rate_hz`, as if a host
  /// had just set it up.
  void start_inertial(double t_s, std::uint16_t rate_hz);

 private:
  enum class State { kOff, kWaking, kConfig, kMeasurement };
  using Command = xsens::Command;

  void power_on(double t_s);
  void handle(const Command& command, double t_s);
  void handle_in_config(const Command& command, double t_s);
  void set_outputs(const Command& command, double t_s);
  void reply(std::uint8_t mid, const Bytes& data, double t_s);
  void enter_measurement(double t_s);
  void emit_samples_until(double t_s, std::vector<Emission>& out);
  void put_item(Bytes& payload, const Output& output, const xsens::MtSample& sample,
                std::int64_t index) const;
  [[nodiscard]] bool is_due(const Output& output, std::int64_t index) const;
  [[nodiscard]] Bytes configuration() const;
  [[nodiscard]] Bytes outputs_data() const;
  [[nodiscard]] std::uint32_t sample_time_fine(std::int64_t index) const;

  Options options_;
  Sampler sampler_;
  std::vector<Output> outputs_;  // kept without power, as is the baud rate
  std::uint8_t baud_code_;
  State state_ = State::kWaking;
  int baud_;
  double wake_deadline_s_ = 0.0;
  double power_on_s_ = 0.0;
  double measurement_end_s_;
  xsens::CommandScanner scanner_;
  std::deque<Emission> replies_;
  SampleGrid grid_;  ///< of the device's 400 Hz
  std::int64_t next_index_ = 0;
  double time_origin_s_;  ///< device time of SampleTimeFine 0
  std::uint16_t packet_;
};

}  // namespace imusim
