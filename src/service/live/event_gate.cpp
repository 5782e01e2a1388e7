#include "service/live/event_gate.h"

#include <algorithm>
#include <utility>

namespace imuscope {

bool EventGate::take(std::size_t bytes, HostTime now) {
  free_ = std::min(free_ + to_seconds(now - looked_) * kEventsPerSecond, kEventsAtOnce);
  looked_ = now;
  if (free_ < 1.0 || bytes > kLongestEventBytes) {
    ++refused_;
    return false;
  }
  free_ -= 1.0;
  return true;
}

std::uint64_t EventGate::due_report(HostTime now) {
  if (refused_ == 0 || now - reported_ < kReportPeriod) return 0;
  reported_ = now;
  return std::exchange(refused_, 0);
}

}  // namespace imuscope
