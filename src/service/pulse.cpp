#include "service/pulse.h"

#include <fmt/format.h>
#include <algorithm>

namespace imuscope {

std::vector<std::string> standing_threads(std::span<const Pulse> pulses, HostTime now) {
  std::vector<std::string> sentences;
  for (const auto& pulse : pulses) {
    const Duration age = now - pulse.heartbeat->last();
    if (age < pulse.told_after) continue;
    sentences.push_back(
        fmt::format("the thread {} has stood still for {:.0f} s", pulse.thread, to_seconds(age)));
  }
  return sentences;
}

bool all_alive(std::span<const Pulse> pulses, HostTime now) {
  return std::all_of(pulses.begin(), pulses.end(), [&](const Pulse& pulse) {
    return now - pulse.heartbeat->last() < pulse.given_up_after;
  });
}

}  // namespace imuscope
