#include "service/live/pulse.h"

#include <fmt/format.h>
#include <algorithm>

namespace imuscope {

std::vector<Condition> standing_threads(std::span<const Pulse> pulses, HostTime now) {
  std::vector<Condition> standing;
  for (const auto& pulse : pulses) {
    const Duration age = now - pulse.heartbeat->last();
    if (age < pulse.told_after) continue;
    standing.push_back(
        {alarm_kind::kThread, pulse.thread,
         fmt::format("the thread {} has stood still for {:.0f} s", pulse.thread, to_seconds(age)),
         fmt::format("look at the disk and at what else this PC does; after {:.0f} s the service "
                     "gives no sign of life, and systemd starts it anew",
                     to_seconds(pulse.given_up_after))});
  }
  return standing;
}

bool all_alive(std::span<const Pulse> pulses, HostTime now) {
  return std::all_of(pulses.begin(), pulses.end(), [&](const Pulse& pulse) {
    return now - pulse.heartbeat->last() < pulse.given_up_after;
  });
}

}  // namespace imuscope
