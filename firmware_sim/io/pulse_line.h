#pragma once

/// A pulse on its way into the PC: its edge raises an interrupt, in which the kernel reads its clocks, and
/// who asks the kernel ten times a second is told of the newest one. What is handed out is the form in which
/// imuscope records pulses, 32 bytes, least significant byte first: "PPSa", the count (u32), CLOCK_MONOTONIC
/// (i64, ns), CLOCK_REALTIME (i64, ns), how far apart the two were read (u32, ns), 0 (u32).

#include <cstdint>
#include <deque>
#include <functional>
#include <span>

#include "firmware_sim/devices/device.h"
#include "firmware_sim/devices/utc.h"
#include "firmware_sim/io/pc_clock.h"
#include "firmware_sim/random/random.h"

namespace imusim {

struct PulseLineOptions {
  std::int64_t host_begin_ns = 0;  ///< CLOCK_MONOTONIC at the scenario's time 0
  PcClock clock;
  Utc wall_begin{};                ///< CLOCK_REALTIME then
  double interrupt_mean_s = 2e-6;  ///< until the kernel has read its clock, exponentially distributed
  double late_share = 0.01;        ///< of pulses whose interrupt has to wait
  double late_mean_s = 100e-6;     ///< for so long, likewise
};

class PulseLine {
 public:
  using OnRead = std::function<void(std::span<const std::uint8_t> bytes, std::int64_t arrival_ns)>;

  PulseLine(const PulseLineOptions& options, const Random& random) : options_(options), random_(random) {}

  /// @param pulse  of a PulseOutput: an instant
  void send(const Emission& pulse);

  /// Hands out the records of the pulses that were asked for before t_s.
  void deliver_until(double t_s, const OnRead& on_read);

 private:
  [[nodiscard]] std::int64_t host_ns(double t_s) const;

  PulseLineOptions options_;
  Random random_;
  std::uint32_t count_ = 0;
  std::deque<double> waiting_;  ///< instants at which the kernel read its clock
};

}  // namespace imusim
