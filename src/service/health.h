#pragma once

/// The health of a live run in words and numbers: what STATUS carries beyond plain counts. Soft world.

#include <map>
#include <string>
#include <vector>

#include "calibration/estimator_config.h"
#include "publish/reports.h"
#include "rt/periodic.h"
#include "service/core.h"

namespace imuscope {

/// The whole service in one word, with its reason.
struct Health {
  std::string state;  ///< starting, aligning, running, degraded, failed
  std::string reason;
};

/// Judges a report whose devices, studies, threads, rings, problems and capture are filled in. The worst
/// thing wins: failed (nothing can come of this run as it stands), then starting, degraded (results are less
/// than they could be, or are being lost), aligning, running.
[[nodiscard]] Health judge(const StatusReport& report);

/// Calibration of one S-IMU in a word.
[[nodiscard]] const char* name_of(StudyStatus status);

/// Calibration of one S-IMU beside its goals.
[[nodiscard]] StatusReport::Study study_status(const std::string& name, const StudyOutput& study,
                                               const StudyConfig& config);

[[nodiscard]] StatusReport::Quantiles quantiles_of(const LatenessHistogram& histogram);

/// Scheduling and processor time of every thread of this process, as the kernel has them.
class ThreadWatch {
 public:
  /// @return one entry a thread, in the order of their start; ticks and lateness are left empty
  [[nodiscard]] std::vector<StatusReport::Thread> look(HostTime now);

 private:
  std::map<int, Duration> cpu_;  ///< by thread id, at the last look
  HostTime last_{};
};

}  // namespace imuscope
