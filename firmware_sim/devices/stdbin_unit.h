#pragma once

/// An Ixsea Airins: sends StdBin V3 telegrams on the UTC grid of its synchronised clock, and hears nothing.
/// After a loss of power it boots, counts its telegrams from 0 and aligns anew: until then it calls its
/// angles invalid. Blocks that can be left out: "raw_acceleration", "raw_rotation_rate", "position", "speed",
/// "attitude", "date", "status".

#include <cstdint>
#include <functional>
#include <vector>

#include "firmware_sim/devices/device.h"
#include "firmware_sim/devices/sample_grid.h"
#include "firmware_sim/devices/stdbin_encoder.h"
#include "firmware_sim/devices/utc.h"

namespace imusim {

class StdbinUnit : public Device {
 public:
  /// Everything but the telegram's time and counter, of an instant.
  using Sampler = std::function<stdbin::Telegram(double t_s)>;

  struct Options {
    Utc utc_begin{};  ///< UTC at the scenario's time 0
    double rate_hz = 100.0;
    std::int64_t phase_100us = 0;  ///< time of the first sample
    double latency_s = 0.001;      ///< from the sampling instant to the first bit of the telegram
    std::uint32_t first_counter = 0;
    double alignment_s = 60.0;  ///< from the end of the boot, after a loss of power
    int baud = 460800;
  };

  StdbinUnit(const Options& options, Sampler sampler);

  void receive(std::span<const std::uint8_t> /*bytes*/, double /*t_s*/) override {}
  void run_until(double t_s, std::vector<Emission>& out) override;
  void power_cycle(double t_s, double off_s) override;
  void jump_clock(double by_s) override { grid_.jump(by_s); }
  void add_skew(double ppm) override { grid_.set_skew(grid_.skew_ppm() + ppm, next_index_); }
  bool leave_out(const std::vector<std::string>& blocks) override;
  [[nodiscard]] int baud() const override { return options_.baud; }

  /// Sends nothing of what lies before t_s.
  void skip_to(double t_s);

 private:
  [[nodiscard]] stdbin::Telegram telegram_of(std::int64_t index);

  Options options_;
  Sampler sampler_;
  SampleGrid grid_;
  std::int64_t next_index_ = 0;
  std::int64_t counted_from_ = 0;  ///< sample whose telegram counts options_.first_counter, or 0 after a boot
  double aligned_s_ = -1e300;
  std::vector<std::string> left_out_;
};

}  // namespace imusim
