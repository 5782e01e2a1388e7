#include "rt/host_clock.h"

#include <gtest/gtest.h>

#include <ctime>

namespace imuscope {
namespace {

std::int64_t monotonic_ns() {
  constexpr std::int64_t kNsPerSecond = 1'000'000'000;
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * kNsPerSecond + now.tv_nsec;
}

// Whoever sets the PC's clock during a run (a person, NTP) does not disturb the stamps.
TEST(HostClock, StampsAreOfTheMonotonicClockWhichNobodyCanSet) {
  for (int i = 0; i < 1000; ++i) {
    const std::int64_t before_ns = monotonic_ns();
    const std::int64_t stamp_ns = to_ns(host_now());
    ASSERT_GE(stamp_ns, before_ns);
    ASSERT_LE(stamp_ns, monotonic_ns());
  }
}

}  // namespace
}  // namespace imuscope
