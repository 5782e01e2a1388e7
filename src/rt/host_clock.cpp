#include "rt/host_clock.h"

#include <ctime>

namespace imuscope {
namespace {

std::int64_t read_clock_ns(clockid_t clock) noexcept {
  constexpr std::int64_t kNsPerSecond = 1'000'000'000;
  timespec now{};
  clock_gettime(clock, &now);  // cannot fail for these two clocks
  return std::int64_t{now.tv_sec} * kNsPerSecond + now.tv_nsec;
}

}  // namespace

HostTime host_now() noexcept { return host_time_from_ns(read_clock_ns(CLOCK_MONOTONIC)); }
UtcTime wall_clock_now() noexcept { return utc_time_from_ns(read_clock_ns(CLOCK_REALTIME)); }

}  // namespace imuscope
