#pragma once

/// Firmware of an Xbus Master with several MTx on its bus, on one serial line: a message at each sampling
/// instant holds a sample counter of its own and then one block a device, in the order of their bus ids. Each
/// device has output mode and settings of its own, set through its bus id; the period is common. A message of
/// more than 254 bytes uses the extended length.
///
/// Blocks that can be left out: "1", "2", ...: the device with this bus id fell off the bus, and its block
/// repeats what it last held.

#include <cstdint>
#include <functional>
#include <vector>

#include "firmware_sim/devices/xsens_encoder.h"
#include "firmware_sim/devices/xsens_unit.h"

namespace imusim {

class XsensXbus final : public XsensUnit {
 public:
  /// @param device   place on the bus, from 0
  /// @param counter  counts samples from the first one on, not wrapped
  using Sampler = std::function<xsens::MtSample(std::size_t device, double t_s, std::int64_t counter)>;

  struct Options {
    std::uint32_t device_id = 0x00100001;    ///< of the head
    std::vector<std::uint32_t> bus_devices;  ///< ids of the MTx, by bus id
    double latency_s = 0.002;
    double clock_skew_ppm = 0.0;
    double first_sample_s = 0.0;
    std::uint16_t first_counter = 0;
    std::uint16_t period = 1152;
    int baud = 460800;
  };

  XsensXbus(const Options& options, Sampler sampler, double power_on_s);

  void jump_clock(double by_s) override;
  bool leave_out(const std::vector<std::string>& blocks) override;
  [[nodiscard]] int baud() const override { return options_.baud; }

  /// Starts measuring calibrated rates and forces with the sample counter, as if a host had just set it up.
  void start_calibrated(double t_s);

 private:
  struct BusDevice {
    std::uint32_t id = 0;
    std::uint16_t output_mode = xsens::kModeOrientation;
    std::uint32_t output_settings = xsens::kSettingsCounter;
    bool is_off = false;
    Bytes last_block;
    [[nodiscard]] std::uint16_t data_length() const;
  };

  [[nodiscard]] bool is_addressed(const Command& /*command*/) const override { return true; }
  void acknowledge(const Command& command, double t_s) override { reply(command, {}, t_s); }
  void count_anew() override { counter_offset_ = -next_index_; }
  void handle_in_config(const Command& command, double t_s) override;
  void handle_for_head(const Command& command, double t_s);
  void handle_for_device(const Command& command, BusDevice& device, double t_s);
  void reply(const Command& command, const Bytes& data, double t_s);
  void error(const Command& command, std::uint8_t code, double t_s);
  void emit_samples_until(double t_s, std::vector<Emission>& out) override;
  [[nodiscard]] Bytes configuration() const override;

  Options options_;
  Sampler sampler_;
  std::vector<BusDevice> bus_;
  std::uint16_t period_;
  std::uint16_t skip_factor_ = 0;
  std::int64_t counter_offset_;
};

}  // namespace imusim
