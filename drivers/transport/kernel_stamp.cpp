#include "drivers/transport/kernel_stamp.h"

#include <linux/errqueue.h>
#include <linux/net_tstamp.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <ctime>

namespace imuscope {

namespace {

/// Both clocks are read one after the other: preemption between the two looks like a step of its length.
constexpr Duration kReadingJitter = std::chrono::milliseconds(1);
/// NTP slews the wall clock by at most 500 ppm (adjtimex(2)).
constexpr std::int64_t kSlewDivisor = 2000;
/// Frames that a mean is over.
constexpr std::uint64_t kLeadFrames = 200;

/// A thread that lost the processor between two readings tries again, so often at most.
constexpr int kClockReadings = 5;
constexpr Duration kApartGood = std::chrono::nanoseconds(500);

std::int64_t ns_of(const timespec& time) noexcept {
  return (std::chrono::seconds(time.tv_sec) + Duration(time.tv_nsec)).count();
}

std::int64_t clock_ns(clockid_t clock) noexcept {
  timespec now{};
  clock_gettime(clock, &now);
  return ns_of(now);
}

}  // namespace

bool ask_for_stamps(int fd) noexcept {
  constexpr int kStamps = SOF_TIMESTAMPING_RX_SOFTWARE | SOF_TIMESTAMPING_SOFTWARE |
                          SOF_TIMESTAMPING_RX_HARDWARE | SOF_TIMESTAMPING_RAW_HARDWARE |
                          SOF_TIMESTAMPING_OPT_PKTINFO;
  return setsockopt(fd, SOL_SOCKET, SO_TIMESTAMPING, &kStamps, sizeof kStamps) == 0;
}

KernelStamps stamps_of(const msghdr& message) noexcept {
  KernelStamps stamps;
  // The macros take no constant; nothing is written.
  auto& header = const_cast<msghdr&>(message);
  for (cmsghdr* told = CMSG_FIRSTHDR(&header); told != nullptr; told = CMSG_NXTHDR(&header, told)) {
    if (told->cmsg_level != SOL_SOCKET) continue;
    if (told->cmsg_type == SO_TIMESTAMPING && told->cmsg_len >= CMSG_LEN(sizeof(scm_timestamping))) {
      scm_timestamping times{};
      std::memcpy(&times, CMSG_DATA(told), sizeof times);
      stamps.software_ns = ns_of(times.ts[0]);
      stamps.hardware_ns = ns_of(times.ts[2]);
    } else if (told->cmsg_type == SCM_TIMESTAMPING_PKTINFO &&
               told->cmsg_len >= CMSG_LEN(sizeof(scm_ts_pktinfo))) {
      scm_ts_pktinfo info{};
      std::memcpy(&info, CMSG_DATA(told), sizeof info);
      stamps.interface = info.if_index;
    }
  }
  return stamps;
}

BothClocks read_both_clocks() noexcept {
  BothClocks best;
  best.apart = Duration::max();
  for (int i = 0; i < kClockReadings && best.apart > kApartGood; ++i) {
    const std::int64_t before_ns = clock_ns(CLOCK_MONOTONIC);
    const std::int64_t wall_ns = clock_ns(CLOCK_REALTIME);
    const std::int64_t after_ns = clock_ns(CLOCK_MONOTONIC);
    const Duration apart{after_ns - before_ns};
    if (apart < best.apart)
      best = {host_time_from_ns(before_ns + apart.count() / 2), utc_time_from_ns(wall_ns), apart};
  }
  return best;
}

void KernelStampMap::begin_read(UtcTime wall_now, HostTime host_now) noexcept {
  const Duration offset = wall_now.time_since_epoch() - host_now.time_since_epoch();
  const Duration expected_change = kReadingJitter + (host_now - read_) / kSlewDivisor;
  if (has_offset_ && std::chrono::abs(offset - wall_minus_host_) > expected_change) {
    trusted_from_ = host_now;
    ++clock_steps_;
  }
  wall_minus_host_ = offset;
  has_offset_ = true;
  read_ = host_now;
}

HostTime KernelStampMap::software_time(std::int64_t software_ns) const noexcept {
  if (software_ns == 0) return read_;
  const HostTime time = host_time_from_ns(software_ns) - wall_minus_host_;
  // A frame that waited while the clock was stepped may be read long after the read that found the step.
  return time < trusted_from_ ? read_ : std::min(time, read_);
}

HostTime KernelStampMap::map(const KernelStamps& stamps) noexcept {
  HostTime time = software_time(stamps.software_ns);
  // Frames of one line may come through two cards: the clock of the first is followed.
  if (stamps.hardware_ns != 0 && hardware_stamps_ == 0) interface_ = stamps.interface;
  const bool by_card = stamps.hardware_ns != 0 && stamps.interface == interface_;
  if (by_card) {
    ++hardware_stamps_;
    time = std::min(hardware_.observe(stamps.hardware_ns, time), read_);
  }
  by_ = by_card ? StampedBy::kInterface : stamps.software_ns != 0 ? StampedBy::kKernel : StampedBy::kRead;
  last_ = std::max(last_, time);
  const double lead_s = to_seconds(read_ - last_);
  leads_ = std::min(leads_ + 1, kLeadFrames);
  const double share = 1.0 / static_cast<double>(leads_);
  const double step_s = lead_s - lead_mean_s_;
  lead_mean_s_ += share * step_s;
  lead_variance_s2_ += share * (step_s * step_s * (1.0 - share) - lead_variance_s2_);
  return last_;
}

}  // namespace imuscope
