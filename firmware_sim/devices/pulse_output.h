#pragma once

/// A receiver's pulse output: one pulse at the beginning of each second of UTC, while it has a fix. An
/// emission of it is one pulse, which has no bytes. There is nothing to be left out.

#include "firmware_sim/devices/device.h"
#include "firmware_sim/devices/sample_grid.h"
#include "firmware_sim/devices/utc.h"

namespace imusim {

class PulseOutput : public Device {
 public:
  struct Options {
    Utc utc_begin{};  ///< UTC at the scenario's time 0
  };

  explicit PulseOutput(const Options& options);

  void receive(std::span<const std::uint8_t> /*bytes*/, double /*t_s*/) override {}
  void run_until(double t_s, std::vector<Emission>& out) override;
  void power_cycle(double t_s, double off_s) override;
  void jump_clock(double by_s) override { grid_.jump(by_s); }
  void add_skew(double ppm) override { grid_.set_skew(grid_.skew_ppm() + ppm, next_index_); }
  bool leave_out(const std::vector<std::string>& blocks) override { return blocks.empty(); }
  [[nodiscard]] int baud() const override { return 0; }

  /// Gives no pulse before t_s.
  void skip_to(double t_s) { next_index_ = std::max(next_index_, grid_.first_from(t_s)); }

 private:
  SampleGrid grid_;
  std::int64_t next_index_ = 0;
};

}  // namespace imusim
