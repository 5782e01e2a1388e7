#pragma once

/// The health of a live run in words and numbers: what STATUS carries beyond plain counts. Non-real-time.

#include <imuscope/status_t.hpp>
#include <map>
#include <string>
#include <vector>

#include "configuration/config.h"
#include "rt/periodic.h"
#include "service/pipeline/core.h"
#include "service/run/alarms.h"
#include "service/run/time_budget.h"

namespace imuscope {

/// The whole service in one word, with its reason.
struct Health {
  std::string state;  ///< starting, aligning, running, degraded, failed
  std::string reason;
};

/// Whether two reasons differ in their numbers at most: a count that grows is the same thing said again.
[[nodiscard]] bool says_the_same(std::string a, std::string b);

/// Whether samples come.
[[nodiscard]] bool streams(const device_status_t& device);

/// Judges a status whose devices, studies, threads, rings, alarms and capture are filled in. The worst
/// thing wins: failed (nothing can come of this run as it stands), then starting, degraded (results are less
/// than they could be, or are being lost), aligning, running.
[[nodiscard]] Health judge(const status_t& status);

/// What is wrong with devices and queues by the status alone.
/// @param counts  of the looks before
[[nodiscard]] std::vector<Condition> conditions_of(const status_t& status, GrowingCounts& counts,
                                                   HostTime now);

/// What is known of a run before anything happens: its names, and its devices with nothing but theirs.
[[nodiscard]] status_t status_of(const Configuration& configuration, const std::string& version);

/// As STATUS and run.json have it: "none", "reference", "gnss", "pc".
[[nodiscard]] std::string_view name_of(UtcSource source) noexcept;

/// Who tells UTC and how well.
void set_time_scale(const TimeScale& scale, status_t& status);
/// Where a device's times come from.
void set_time_budget(const TimeBudget& budget, device_status_t& device);
/// Calibration of one S-IMU beside its goals.
[[nodiscard]] study_status_t study_status(const std::string& name, const SImuOutput& study);

/// Ticks and lateness of a thread with deadlines.
/// @param before_deadline  from the instant that its work is of to its deadline
void set_beat(const PeriodicStatistics& beat, Duration before_deadline, thread_status_t& thread);

/// Every array of a status has a field that counts it.
void count_elements(status_t& status);

/// Scheduling and processor time of every thread of this process, as the kernel has them.
class ThreadWatch {
 public:
  /// @return one entry a thread, in the order of their start; ticks are zero and lateness is unknown
  [[nodiscard]] std::vector<thread_status_t> look(HostTime now);

 private:
  std::map<int, Duration> cpu_;  ///< by thread id, at the last look
  HostTime last_{};
};

}  // namespace imuscope
