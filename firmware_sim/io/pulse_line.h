#pragma once

/// A pulse on its way into the PC: its edge raises an interrupt, in which the kernel reads its clocks, and
/// who asks the kernel fifty times a second is told of the newest one. What is handed out is the form in
/// which imuscope records pulses, 32 bytes, least significant byte first: "PPSa", the count (u32),
/// CLOCK_MONOTONIC (i64, ns), CLOCK_REALTIME (i64, ns), how far apart the two were read (u32, ns), 0 (u32).
///
/// And how NTP steers the PC's clock: who asks, fifty times a second, reads CLOCK_MONOTONIC_RAW as well, and
/// tells where it leaves the line that was told last by more than half a microsecond: "PPSq", how far apart
/// the two were read (u32, ns), CLOCK_MONOTONIC (i64, ns), CLOCK_MONOTONIC_RAW (i64, ns), seconds of the
/// latter in one of the former minus 1 (i32, 1e-9), 0 (u32).

#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
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
  bool tells_steering = true;      ///< false: older recordings, and a kernel's part alone
  double reading_sd_s = 0.1e-6;    ///< of the two clocks against each other
};

class PulseLine {
 public:
  using OnRead = std::function<void(std::span<const std::uint8_t> bytes, std::int64_t arrival_ns)>;

  /// @param random         of interrupts
  /// @param quartz_random  of readings of the quartz
  PulseLine(const PulseLineOptions& options, const Random& random, const Random& quartz_random)
      : options_(options), random_(random), quartz_random_(quartz_random) {}

  /// @param pulse  of a PulseOutput: an instant
  void send(const Emission& pulse);

  /// Hands out the records of the pulses that were asked for before t_s.
  void deliver_until(double t_s, const OnRead& on_read);

 private:
  [[nodiscard]] std::int64_t host_ns(double t_s) const;
  void ask(double t_s, const OnRead& on_read);
  void read_quartz(double t_s, const OnRead& on_read);
  void tell_pulse(double stamped_s, double asked_s, const OnRead& on_read);

  PulseLineOptions options_;
  Random random_;
  Random quartz_random_;
  std::uint32_t count_ = 0;
  std::deque<double> waiting_;  ///< instants at which the kernel read its clock
  double newest_pulse_s_ = -std::numeric_limits<double>::infinity();
  std::int64_t asked_ = 0;  ///< times
  struct Reading {
    std::int64_t host_ns = 0;
    std::int64_t unsteered_ns = 0;
    double rate = 0.0;
  };
  std::deque<Reading> readings_;  ///< since the quartz took the line that it is on, half a second at most
  Reading told_;
  bool has_told_ = false;
};

}  // namespace imusim
