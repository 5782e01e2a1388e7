#include "drivers/transport/kernel_stamp.h"

#include <algorithm>
#include <chrono>

namespace imuscope {

namespace {

/// Both clocks are read one after the other: preemption between the two looks like a step of its length.
constexpr Duration kReadingJitter = std::chrono::milliseconds(1);
/// NTP slews the wall clock by at most 500 ppm (adjtimex(2)).
constexpr std::int64_t kSlewDivisor = 2000;

}  // namespace

void KernelStampMap::begin_read(UtcTime wall_now, HostTime host_now) noexcept {
  const Duration offset = wall_now.time_since_epoch() - host_now.time_since_epoch();
  const Duration expected_change = kReadingJitter + (host_now - read_) / kSlewDivisor;
  stepped_ = has_offset_ && std::chrono::abs(offset - wall_minus_host_) > expected_change;
  clock_steps_ += stepped_ ? 1 : 0;
  wall_minus_host_ = offset;
  has_offset_ = true;
  read_ = host_now;
}

HostTime KernelStampMap::software_time(std::int64_t software_ns) const noexcept {
  if (software_ns == 0 || stepped_) return read_;
  return std::min(host_time_from_ns(software_ns) - wall_minus_host_, read_);
}

HostTime KernelStampMap::map(const KernelStamps& stamps) noexcept {
  HostTime time = software_time(stamps.software_ns);
  if (stamps.hardware_ns != 0) {
    ++hardware_stamps_;
    time = std::min(hardware_.observe(stamps.hardware_ns, time), read_);
  }
  last_ = std::max(last_, time);
  return last_;
}

}  // namespace imuscope
