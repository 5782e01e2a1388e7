#pragma once

/// How much of what calls itself a person's event is taken: no person marks more, and what a bus floods the
/// service with must fill neither the log nor the capture.

#include <cstddef>
#include <cstdint>

#include "base/time.h"

namespace imuscope {

/// Thread: one.
class EventGate {
 public:
  static constexpr double kEventsPerSecond = 2.0;
  static constexpr double kEventsAtOnce = 20.0;
  /// Encoded; `imuscope top` sends texts of at most 200 characters.
  static constexpr std::size_t kLongestEventBytes = 1000;
  /// What was refused is told this often at most.
  static constexpr Duration kReportPeriod = std::chrono::seconds(30);

  /// @param bytes  the event's length as it came
  /// @return whether it is to be taken
  bool take(std::size_t bytes, HostTime now);

  /// Refused since the last report, where one is due; otherwise 0.
  std::uint64_t due_report(HostTime now);

 private:
  double free_ = kEventsAtOnce;
  HostTime looked_{};
  std::uint64_t refused_ = 0;
  HostTime reported_{};
};

}  // namespace imuscope
