#pragma once

/// The beat of the estimator: ticks at absolute deadlines t0 + k * period, whatever happened before.

#include <cstdint>

#include "base/time.h"
#include "rt/lateness_histogram.h"

namespace imuscope {

/// One beat. The work of a tick depends on `index` and `cut` alone, never on the wake-up, so that a replay
/// can repeat it.
struct Tick {
  std::int64_t index;    ///< k, from 0
  HostTime cut;          ///< t0 + k * period: the tick consumes what arrived at or before it
  std::int64_t skipped;  ///< ticks passed over since the one before: their samples fall to this tick
  Duration lateness;     ///< from the first deadline due to the wake-up; for statistics only
};

/// Counts since construction; trivially copyable, to cross a LatestValue to the publisher.
struct PeriodicStatistics {
  std::uint64_t ticks = 0;     ///< delivered
  std::uint64_t overruns = 0;  ///< ticks whose work went past the next deadline
  std::uint64_t skipped = 0;   ///< ticks never delivered, by overrun or late wake-up
  LatenessHistogram lateness;  ///< wake-up after the first deadline due
  LatenessHistogram done;      ///< end of a tick's work after its cut
};

/// The arithmetic of the beat without clock and sleep: which tick is next and what a wake-up delivers.
/// A delay is never made up by a burst of ticks: when several are due, only the newest is delivered and the
/// others are counted as skipped.
class TickSchedule {
 public:
  /// @param t0      cut of tick 0
  /// @param period  > 0
  TickSchedule(HostTime t0, Duration period) noexcept;

  /// Deadline of the next tick.
  [[nodiscard]] HostTime deadline() const noexcept { return next_deadline_; }

  /// The work of the tick that deadline_reached() delivered last is over at `now`. Counts an overrun if the
  /// next deadline has passed.
  void finish(HostTime now) noexcept;

  /// The tick that a wake-up at `now` delivers.
  /// @param now at or after deadline()
  [[nodiscard]] Tick deadline_reached(HostTime now) noexcept;

  [[nodiscard]] const PeriodicStatistics& statistics() const noexcept { return statistics_; }

 private:
  HostTime next_deadline_;
  Duration period_;
  std::int64_t next_index_ = 0;
  PeriodicStatistics statistics_;
};

/// The beat on CLOCK_MONOTONIC by clock_nanosleep with absolute deadlines. Thread: one. Allocates: never.
class PeriodicLoop {
 public:
  /// @param t0 cut of tick 0; normally a little in the future
  PeriodicLoop(HostTime t0, Duration period) noexcept : schedule_(t0, period) {}

  /// Sleeps until the next deadline (not at all where it has passed) and returns the tick. Signals do not
  /// shorten the sleep; it lasts at most one period.
  [[nodiscard]] Tick wait() noexcept;

  [[nodiscard]] const PeriodicStatistics& statistics() const noexcept { return schedule_.statistics(); }

 private:
  TickSchedule schedule_;
  bool first_ = true;
};

/// Sleeps until `deadline` on CLOCK_MONOTONIC; returns at once where it has passed.
void sleep_until(HostTime deadline) noexcept;

}  // namespace imuscope
