#include "service/run/time_budget.h"

#include <array>
#include <cmath>

#include "base/calibration_levels.h"

namespace imuscope {

std::string_view name_of(StampedBy by) noexcept {
  constexpr std::array<std::string_view, 3> kNames{"read", "kernel", "interface"};
  return kNames[static_cast<std::size_t>(by)];
}

TimeBudget time_budget(const LineStatus& line, const SImuOutput* study, DeviceRole role,
                       const PulseState& pulses) noexcept {
  TimeBudget budget;
  budget.stamped_by = line.stamps.by;
  if (line.stamps.by != StampedBy::kRead) {
    budget.stamp_lead_s = line.stamps.lead_s;
    budget.stamp_lead_sd_s = line.stamps.lead_sd_s;
  }
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
  const StreamDelay& reference = pulses.reference_delay;
  if (role == DeviceRole::kReference) {
    budget.delay_s = reference.mean_s;
    budget.sd_delay_s = reference.sd_s;
  } else if (role == DeviceRole::kGnss) {
    budget.delay_s = pulses.gnss_delay.mean_s;
    budget.sd_delay_s = pulses.gnss_delay.sd_s;
  } else if (role == DeviceRole::kStudy) {
    // A sample shows the reference's motion at its time + t_d, and that of the reference is so much too late.
    budget.delay_s = reference.mean_s - budget.t_d_s;
    budget.sd_delay_s = std::hypot(reference.sd_s, budget.sd_t_d_s);
  }
  return budget;
}

}  // namespace imuscope
