#pragma once

/// A GNSS receiver that speaks GREIS: sends the stored set of messages at 10 Hz from power-on, and hears the
/// commands `em` (start messages), `dm` (stop) and `set` (accepted and forgotten), with or without a %id%
/// prefix. After a loss of power it sends the stored set again once it has a position. Messages that can be
/// left out are those of the set: "RT", "RD", "ST", "PG", "VG", "SG", "DP", "ET".

#include <functional>
#include <string>
#include <vector>

#include "firmware_sim/devices/device.h"
#include "firmware_sim/devices/greis_encoder.h"
#include "firmware_sim/devices/sample_grid.h"
#include "firmware_sim/devices/utc.h"

namespace imusim {

class GreisReceiver : public Device {
 public:
  /// Everything but the date and time, of an epoch.
  using Solver = std::function<greis::Solution(double t_s)>;

  struct Options {
    Utc utc_begin{};  ///< UTC at the scenario's time 0
    double rate_hz = 10.0;
    double latency_s = 0.040;  ///< from the epoch to the first bit
    int baud = 115200;
  };

  GreisReceiver(const Options& options, Solver solver);

  void receive(std::span<const std::uint8_t> bytes, double t_s) override;
  void run_until(double t_s, std::vector<Emission>& out) override;
  void power_cycle(double t_s, double off_s) override;
  void jump_clock(double by_s) override { grid_.jump(by_s); }
  void add_skew(double ppm) override { grid_.set_skew(grid_.skew_ppm() + ppm, next_index_); }
  bool leave_out(const std::vector<std::string>& blocks) override;
  [[nodiscard]] int baud() const override { return options_.baud; }

  /// Sends nothing of the epochs before t_s.
  void skip_to(double t_s);

 private:
  void handle(std::string line, double t_s);
  [[nodiscard]] bool enable(const std::string& arguments);
  [[nodiscard]] Bytes epoch_bytes(std::int64_t index) const;

  Options options_;
  Solver solver_;
  SampleGrid grid_;
  std::int64_t next_index_ = 0;
  std::vector<std::string> enabled_;
  std::int64_t epochs_per_output_ = 1;
  std::string heard_;
  std::vector<Emission> replies_;
  std::vector<std::string> left_out_;
};

}  // namespace imusim
