#pragma once

/// An Ixsea Airins: sends StdBin V3 telegrams on the UTC grid of its synchronised clock, and hears nothing.

#include <cstdint>
#include <functional>
#include <vector>

#include "firmware_sim/devices/device.h"
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
    int baud = 460800;
  };

  StdbinUnit(const Options& options, Sampler sampler) : options_(options), sampler_(std::move(sampler)) {}

  void receive(std::span<const std::uint8_t> /*bytes*/, double /*t_s*/) override {}
  void run_until(double t_s, std::vector<Emission>& out) override;
  [[nodiscard]] int baud() const override { return options_.baud; }

  /// Sends nothing of what lies before t_s.
  void skip_to(double t_s);

 private:
  [[nodiscard]] double sample_time(std::int64_t index) const;

  Options options_;
  Sampler sampler_;
  std::int64_t next_index_ = 0;
};

}  // namespace imusim
