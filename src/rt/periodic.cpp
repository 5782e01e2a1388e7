#include "rt/periodic.h"

#include <cerrno>
#include <ctime>

#include "base/contracts.h"
#include "rt/host_clock.h"

namespace imuscope {

TickSchedule::TickSchedule(HostTime t0, Duration period) noexcept : next_deadline_(t0), period_(period) {
  IMUSCOPE_EXPECTS(period > Duration::zero());
}

void TickSchedule::finish(HostTime now) noexcept {
  if (now > next_deadline_) statistics_.overruns += 1;
  statistics_.done.add(now - (next_deadline_ - period_));
}

Tick TickSchedule::deadline_reached(HostTime now) noexcept {
  IMUSCOPE_EXPECTS(now >= next_deadline_);
  const Duration lateness = now - next_deadline_;
  const std::int64_t skipped = lateness / period_;
  next_index_ += skipped;
  next_deadline_ += skipped * period_;
  const Tick tick{next_index_, next_deadline_, skipped, lateness};
  next_index_ += 1;
  next_deadline_ += period_;
  statistics_.ticks += 1;
  statistics_.skipped += static_cast<std::uint64_t>(skipped);
  statistics_.lateness.add(lateness);
  return tick;
}

Tick PeriodicLoop::wait() noexcept {
  if (!first_) schedule_.finish(host_now());
  first_ = false;
  sleep_until(schedule_.deadline());
  return schedule_.deadline_reached(host_now());
}

void sleep_until(HostTime deadline) noexcept {
  constexpr std::int64_t kNsPerSecond = 1'000'000'000;
  const std::int64_t ns = to_ns(deadline);
  timespec until{};
  until.tv_sec = ns / kNsPerSecond;
  until.tv_nsec = ns % kNsPerSecond;
  // An absolute deadline makes the call restartable: a signal costs nothing.
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {
  }
}

}  // namespace imuscope
