#pragma once

/// A device on a CAN bus: it sends at its own instants and hears nothing. An emission of it is one classic
/// frame: the identifier of 11 bits, most significant byte first, then 0 to 8 bytes of data.

#include <functional>

#include "firmware_sim/devices/device.h"
#include "firmware_sim/devices/sample_grid.h"

namespace imusim {

struct CanFrame {
  std::uint16_t id = 0;
  Bytes data;
};

[[nodiscard]] Bytes pack(const CanFrame& frame);
[[nodiscard]] CanFrame unpack(std::span<const std::uint8_t> bytes);

class CanNode : public Device {
 public:
  /// The frames of one instant, in the order of sending.
  /// @param t_s       scenario time
  /// @param device_s  the same by the device's clock
  /// @param index     counts the instants, from the first one on
  using Sampler = std::function<std::vector<CanFrame>(double t_s, double device_s, std::int64_t index)>;

  struct Options {
    double rate_hz = 100.0;
    double first_s = 0.0;
    double clock_skew_ppm = 0.0;  ///< positive: the device's clock is fast, so it sends more often
    double latency_s = 0.001;     ///< from an instant until its first frame is received on an idle bus
  };

  CanNode(const Options& options, Sampler sampler);

  /// What lies before is not sent.
  void skip_to(double t_s) { next_index_ = std::max(next_index_, grid_.first_from(t_s)); }

  void receive(std::span<const std::uint8_t> bytes, double t_s) override;
  void run_until(double t_s, std::vector<Emission>& out) override;
  void power_cycle(double t_s, double off_s) override { skip_to(t_s + off_s); }
  void jump_clock(double by_s) override { grid_.jump(by_s); }
  void add_skew(double ppm) override { grid_.set_skew(grid_.skew_ppm() + ppm, next_index_); }
  /// Blocks are identifiers of three hexadecimal digits.
  bool leave_out(const std::vector<std::string>& blocks) override;
  [[nodiscard]] int baud() const override { return 0; }

 private:
  Options options_;
  Sampler sampler_;
  SampleGrid grid_;
  std::int64_t next_index_ = 0;
  std::vector<std::uint16_t> left_out_;
};

}  // namespace imusim
