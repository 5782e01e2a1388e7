#pragma once

/// Firmware of an MTi of the 10/100 series on a serial line, with MTData2: items with rates of their own, a
/// counter (1020) that counts every message, GNSS positions in messages of their own among them, and a
/// SampleTimeFine that begins anew after a day. Its Configuration names no legacy data.

#include <cstdint>
#include <functional>
#include <vector>

#include "firmware_sim/devices/xsens_encoder.h"
#include "firmware_sim/devices/xsens_unit.h"

namespace imusim {

class XsensMti final : public XsensUnit {
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

  void jump_clock(double by_s) override { grid_.jump(by_s); }
  bool leave_out(const std::vector<std::string>& blocks) override { return blocks.empty(); }
  [[nodiscard]] int baud() const override { return baud_; }

  /// Measures rates, forces, the message counter, SampleTimeFine and status word at `rate_hz`, as if a host
  /// had just set it up.
  void start_inertial(double t_s, std::uint16_t rate_hz);

 private:
  [[nodiscard]] bool is_addressed(const Command& command) const override { return command.is_for(1); }
  void acknowledge(const Command& command, double t_s) override;
  void restart() override { baud_ = xsens::baud_of_code(baud_code_); }
  void count_anew() override;
  void handle_in_config(const Command& command, double t_s) override;
  void set_outputs(const Command& command, double t_s);
  void reply(std::uint8_t mid, const Bytes& data, double t_s);
  void emit_samples_until(double t_s, std::vector<Emission>& out) override;
  void put_item(Bytes& payload, const Output& output, const xsens::MtSample& sample,
                std::int64_t index) const;
  [[nodiscard]] bool is_due(const Output& output, std::int64_t index) const;
  [[nodiscard]] Bytes configuration() const override;
  [[nodiscard]] Bytes outputs_data() const;
  [[nodiscard]] std::uint32_t sample_time_fine(std::int64_t index) const;

  Options options_;
  Sampler sampler_;
  std::vector<Output> outputs_;  // kept without power, as is the baud rate
  std::uint8_t baud_code_;
  int baud_;
  double time_origin_s_;  ///< device time of SampleTimeFine 0
  std::uint16_t packet_;
};

}  // namespace imusim
