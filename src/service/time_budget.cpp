#include "service/time_budget.h"

#include "base/calibration_levels.h"

namespace imuscope {

TimeBudget time_budget(const LineStatus& line, const StudyOutput* study) noexcept {
  TimeBudget budget;
  budget.adapter_s = to_seconds(line.timing.held);
  if (line.counters.samples > 0) {
    const auto bytes = static_cast<double>(line.counters.bytes - line.counters.bytes_skipped);
    if (line.epochs > 0)
      budget.wire_s = to_seconds(line.timing.per_byte) * bytes / static_cast<double>(line.epochs);
    budget.latency_s = line.latency_s;
    budget.clock_sd_s = line.clock_sd_s;
    budget.clock_drift_ppm = line.clock_drift_ppm;
  }
  if (study != nullptr && has_estimate(study->status)) {
    budget.t_d_s = study->t_d_s;
    budget.sd_t_d_s = study->sd_t_d_s;
  }
  return budget;
}

}  // namespace imuscope
