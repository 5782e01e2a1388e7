#pragma once

/// The clock of the PC that reads the devices: a quartz with an error of its own that warms up, steered by
/// NTP. Linux steers its monotonic and its wall clock alike, so both run so; what steps is the wall clock
/// alone.

#include <cstdint>
#include <vector>

#include "firmware_sim/random/random.h"

namespace imusim {

class PcClock {
 public:
  /// The rate is changed by so much for a while, as NTP does to take an offset back.
  struct Slew {
    double begin_s;
    double end_s;
    double ppm;
  };
  /// The PC sleeps: its monotonic clock stands still.
  struct Suspend {
    double begin_s;
    double end_s;
  };

  /// A perfect clock.
  PcClock() = default;
  /// Within 50 ppm, up to 2 ppm of warming up, corrections of NTP every 64 s and one of 5 ms.
  static PcClock drawn(Random random, double duration_s);

  double rate_ppm = 0.0;  ///< positive: fast
  double warm_up_ppm = 0.0;
  double warm_up_s = 600.0;  ///< time constant
  std::vector<Slew> slews;
  std::vector<Suspend> suspends;

  /// The same without what NTP does to it, s: CLOCK_MONOTONIC_RAW.
  [[nodiscard]] double unsteered_seconds_at(double t_s) const;
  /// What the clock has counted at t_s since the scenario's time 0, s. Rises with t_s, or stands still.
  [[nodiscard]] double seconds_at(double t_s) const;
  [[nodiscard]] bool is_asleep_at(double t_s) const;
  /// Its rate at t_s against true time, ppm; slews included.
  [[nodiscard]] double ppm_at(double t_s) const;
};

}  // namespace imusim
