#pragma once

/// Are all threads of a run alive? For STATUS, the log and systemd's watchdog.

#include <span>
#include <vector>

#include "rt/heartbeat.h"
#include "service/run/alarms.h"

namespace imuscope {

/// One thread, and how long it may stand still.
struct Pulse {
  const char* thread;
  const Heartbeat* heartbeat;
  Duration told_after;      ///< then it is told as a problem
  Duration given_up_after;  ///< then the service is started anew
};

/// Threads of the core never wait for anything.
inline constexpr Duration kCoreTold = std::chrono::seconds(1);
inline constexpr Duration kCoreGivenUp = std::chrono::seconds(2);
/// Those that write wait for the disk, and a recording outlives a disk that stands still: what comes
/// meanwhile lies in rings. To start anew would lose it.
inline constexpr Duration kWriterTold = std::chrono::seconds(3);
inline constexpr Duration kWriterGivenUp = std::chrono::seconds(60);
/// At idle priority a fit takes minutes on a busy PC, and a quarter of an hour of rows can wait.
inline constexpr Duration kModellerTold = std::chrono::minutes(5);
inline constexpr Duration kModellerGivenUp = std::chrono::minutes(15);

/// Each thread that stands still for longer than may be passed over.
[[nodiscard]] std::vector<Condition> standing_threads(std::span<const Pulse> pulses, HostTime now);

/// Whether every thread has moved within the time that it is given: what systemd is to be told.
[[nodiscard]] bool all_alive(std::span<const Pulse> pulses, HostTime now);

}  // namespace imuscope
