#include "service/run/health.h"

#include <fmt/format.h>
#include <sched.h>
#include <algorithm>
#include <array>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <utility>

#include "base/manoeuvres.h"
#include "base/units.h"
#include "publish/message_values.h"
#include "service/pipeline/observability.h"
#include "service/run/alarms.h"

namespace imuscope {

namespace {

constexpr double kPercent = 100.0;
constexpr double kUsPerS = 1e6;
constexpr std::string_view kReference = "reference";
constexpr std::string_view kStudy = "study";

std::int64_t as_count(std::uint64_t count) { return static_cast<std::int64_t>(count); }

std::string device_reason(const device_status_t& device) {
  return device.problem.empty() ? fmt::format("{}: {}", device.name, device.state)
                                : fmt::format("{}: {}: {}", device.name, device.state, device.problem);
}

/// Something is being lost, though every device streams; empty when nothing is.
std::string loss_reason(const status_t& status) {
  if (status.capture_lost > 0)
    return fmt::format("{} records could not be kept in the capture", status.capture_lost);
  for (const auto& ring : status.rings) {
    if (ring.refused > 0) return fmt::format("the ring '{}' refused {} elements", ring.name, ring.refused);
  }
  for (const auto& device : status.devices) {
    if (device.frames_dropped > 0)
      return fmt::format("{} frames of {} were lost by this PC before they could be read",
                         device.frames_dropped, device.name);
    if (device.samples_refused > 0)
      return fmt::format("{} samples of {} found their ring full", device.samples_refused, device.name);
  }
  return {};
}

/// The first active alarm that is of no device; empty when there is none.
std::string first_trouble(const status_t& status) {
  for (const auto& alarm : status.alarms) {
    if (alarm.active != 0 && alarm.kind != alarm_kind::kDevice)
      return Error{ErrorKind::kWork, alarm.what, alarm.remedy}.text();
  }
  return {};
}

}  // namespace

bool says_the_same(std::string a, std::string b) {
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  std::erase_if(a, is_digit);
  std::erase_if(b, is_digit);
  return a == b;
}

bool streams(const device_status_t& device) { return device.state == "streaming"; }

Health judge(const status_t& status) {
  const auto& devices = status.devices;
  const auto failed = [](const device_status_t& device) { return device.state == "failed"; };
  const auto find = [&](auto condition) { return std::find_if(devices.begin(), devices.end(), condition); };

  if (const auto reference = find([&](const auto& d) { return d.role == kReference && failed(d); });
      reference != devices.end()) {
    return {"failed", device_reason(*reference)};
  }
  const bool any_study = std::any_of(devices.begin(), devices.end(),
                                     [&](const auto& d) { return d.role == kStudy && !failed(d); });
  if (!any_study && !devices.empty()) return {"failed", "no IMU under study can be set up"};

  const bool calibrating = std::any_of(status.studies.begin(), status.studies.end(),
                                       [](const auto& study) { return has_estimate(study.state); });
  if (const auto silent = find([](const auto& d) { return !streams(d); }); silent != devices.end()) {
    return {calibrating || failed(*silent) ? "degraded" : "starting", device_reason(*silent)};
  }
  if (auto loss = loss_reason(status); !loss.empty()) return {"degraded", std::move(loss)};
  if (const std::string trouble = first_trouble(status); !trouble.empty()) return {"degraded", trouble};
  if (!calibrating) return {"aligning", "waiting for motion that shows how the S-IMUs sit"};
  return {"running", "all devices stream"};
}

std::vector<Condition> conditions_of(const status_t& status, GrowingCounts& counts, HostTime now) {
  std::vector<Condition> conditions;
  for (const auto& device : status.devices) {
    if (streams(device)) continue;
    Condition condition = condition_of(alarm_kind::kDevice, device.name, device.problem);
    condition.what = fmt::format("{}: {}{}{}", device.name, device.state, condition.what.empty() ? "" : ": ",
                                 condition.what);
    if (device.problem.empty())
      condition.remedy = "check its power, its cable and its line in the configuration";
    conditions.push_back(std::move(condition));
  }
  const auto add_loss = [&](const char* kind, const std::string& subject, std::int64_t count,
                            std::string what, const char* remedy) {
    if (counts.grows(fmt::format("{} {}", kind, subject), count, now))
      conditions.push_back({kind, subject, std::move(what), remedy});
  };
  for (const auto& device : status.devices) {
    add_loss(alarm_kind::kDeviceLoss, device.name, device.frames_dropped + device.samples_refused,
             fmt::format("{} frames and {} samples of {} were lost by this PC", device.frames_dropped,
                         device.samples_refused, device.name),
             "find what else keeps this PC busy, and let the service run in real time (imuscope doctor)");
  }
  add_loss(alarm_kind::kCaptureLoss, "", status.capture_lost,
           fmt::format("{} records could not be kept in the capture", status.capture_lost),
           "make room on the disk, or record to a faster one");
  for (const auto& ring : status.rings) {
    add_loss(alarm_kind::kRing, ring.name, ring.refused,
             fmt::format("the ring '{}' refused {} elements", ring.name, ring.refused),
             "find what else keeps this PC or its disk busy");
  }
  return conditions;
}

study_status_t study_status(const std::string& name, const SImuOutput& study) {
  const auto largest = [](const Vector3& sd) { return *std::max_element(sd.begin(), sd.end()); };
  study_status_t status{};
  status.name = name;
  status.state = words_of(study.status);
  status.regime = regime_name(study.regime);
  status.goal_psi_deg = study.goal.boresight_sd_rad * kDegPerRad;
  status.goal_r_m = study.goal.lever_arm_sd_m;
  status.goal_t_d_ms = study.goal.time_offset_sd_s * kMsPerS;
  status.samples = as_count(study.counters.samples);
  status.used = as_count(study.counters.used);
  status.late = as_count(study.counters.late);
  for (std::size_t i = 0; i < 3; ++i)
    status.gated += as_count(study.counters.gated_gyro[i] + study.counters.gated_accel[i]);
  if (!has_estimate(study.status)) {
    for (double* unknown : {&status.sd_psi_deg, &status.sd_r_m, &status.sd_t_d_ms, &status.weakest_relative})
      *unknown = kUnknown;
    status.manoeuvre = kTurnBothWays;
    return status;
  }
  const auto observability = observability_of(study);
  status.sd_psi_deg = largest(study.sd_psi_rad) * kDegPerRad;
  status.sd_r_m = largest(study.sd_r_bs_b_m);
  status.sd_t_d_ms = study.sd_t_d_s * kMsPerS;
  status.weakest = observability.weakest;
  status.weakest_relative = observability.weakest_relative_sd;
  status.manoeuvre = observability.advice;
  return status;
}

void set_time_budget(const TimeBudget& budget, device_status_t& device) {
  constexpr double kUsPerS = 1e6;
  device.stamped_by = name_of(budget.stamped_by);
  device.stamp_lead_us = budget.stamp_lead_s * kUsPerS;
  device.stamp_lead_sd_us = budget.stamp_lead_sd_s * kUsPerS;
  device.delay_ms = budget.delay_s * kMsPerS;
  device.sd_delay_ms = budget.sd_delay_s * kMsPerS;
  device.latency_ms = budget.latency_s * kMsPerS;
  device.clock_drift_ppm = budget.clock_drift_ppm;
  device.clock_sd_us = budget.clock_sd_s * kUsPerS;
  device.wire_ms = budget.wire_s * kMsPerS;
  device.adapter_ms = budget.adapter_s * kMsPerS;
  device.t_d_ms = budget.t_d_s * kMsPerS;
  device.sd_t_d_ms = budget.sd_t_d_s * kMsPerS;
}

status_t status_of(const Configuration& configuration, const std::string& version) {
  status_t status{};
  status.run = configuration.run_name;
  status.version = version;
  status.build = fmt::format("g++ {}", __VERSION__);
  status.configuration_hash = configuration.sha256;
  status.refit_duration_s = kUnknown;
  for (const DeviceConfig& device : configuration.devices) {
    device_status_t entry{};
    entry.name = device.name;
    entry.role = name_of(device.role);
    entry.protocol = name_of(device.protocol);
    entry.data_age_s = kUnknown;
    set_time_budget({}, entry);
    status.devices.push_back(std::move(entry));
  }
  return status;
}

std::string_view name_of(UtcSource source) noexcept {
  constexpr std::array<std::string_view, 5> kNames{"none", "reference", "gnss", "pc", "pps"};
  return kNames[static_cast<std::size_t>(source)];
}

void set_time_scale(const TimeScale& scale, status_t& status) {
  const bool told_by_device = is_told_by_device(scale.source);
  status.utc_source = name_of(scale.source);
  status.utc_sd_s = scale.source == UtcSource::kNone ? kUnknown : scale.sd_utc_s;
  status.host_clock_ppm = told_by_device ? -scale.rate * 1e6 : kUnknown;
  status.pulses = as_count(scale.pulses.used);
  status.host_utc_sd_us = scale.pulses.is_known ? scale.pulses.sd_utc_s * 1e6 : kUnknown;
}

void count_elements(status_t& status) {
  status.n_devices = element_count(status.devices);
  status.n_studies = element_count(status.studies);
  for (thread_status_t& thread : status.threads) thread.n_octaves = element_count(thread.lateness_octaves);
  status.n_threads = element_count(status.threads);
  status.n_rings = element_count(status.rings);
  status.n_alarms = element_count(status.alarms);
}

namespace {

/// Median, 99 %, 99.9 % and the worst since the start, after `offset`; NaN where nothing was counted.
std::array<double, 4> quantiles_us(const LatenessHistogram& histogram, Duration offset) {
  constexpr std::array kShares{0.5, 0.99, 0.999};
  std::array<double, 4> quantiles{kUnknown, kUnknown, kUnknown, kUnknown};
  if (histogram.count() == 0) return quantiles;
  const auto us = [&](Duration late) { return to_seconds(late + offset) * kUsPerS; };
  for (std::size_t i = 0; i < kShares.size(); ++i) quantiles[i] = us(histogram.quantile(kShares[i]));
  quantiles.back() = us(histogram.max());
  return quantiles;
}

}  // namespace

void set_beat(const PeriodicStatistics& beat, Duration before_deadline, thread_status_t& thread) {
  thread.ticks = as_count(beat.ticks);
  thread.overruns = as_count(beat.overruns);
  thread.skipped = as_count(beat.skipped);
  const auto lateness = quantiles_us(beat.lateness, Duration::zero());
  const auto done = quantiles_us(beat.done, before_deadline);
  thread.lateness_p50_us = lateness[0];
  thread.lateness_p99_us = lateness[1];
  thread.lateness_p999_us = lateness[2];
  thread.lateness_max_us = lateness[3];
  thread.done_p50_us = done[0];
  thread.done_p99_us = done[1];
  thread.done_p999_us = done[2];
  thread.done_max_us = done[3];
  const auto octaves = beat.lateness.octaves();
  thread.lateness_octaves.assign(octaves.begin(), octaves.end());
}

namespace {

std::string scheduling_of(int thread) {
  switch (sched_getscheduler(thread)) {
    case SCHED_FIFO: {
      sched_param parameters{};
      sched_getparam(thread, &parameters);
      return fmt::format("fifo {}", parameters.sched_priority);
    }
    case SCHED_IDLE:
      return "idle";
    default:
      return "normal";
  }
}

}  // namespace

std::vector<thread_status_t> ThreadWatch::look(HostTime now) {
  std::map<int, thread_status_t> threads;
  std::map<int, Duration> cpu;
  std::error_code vanished;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/task", vanished)) {
    const std::string id_text = entry.path().filename().string();
    int id = 0;
    std::from_chars(id_text.data(), id_text.data() + id_text.size(), id);
    thread_status_t thread{};
    set_beat({}, Duration::zero(), thread);
    thread.lateness_octaves.clear();
    thread.cpu_percent = kUnknown;
    thread.heartbeat_age_s = kUnknown;
    std::ifstream(entry.path() / "comm") >> thread.name;
    std::int64_t ran_ns = 0;
    std::ifstream(entry.path() / "schedstat") >> ran_ns;
    thread.scheduling = scheduling_of(id);
    cpu[id] = Duration{ran_ns};
    const auto before = cpu_.find(id);
    if (before != cpu_.end() && now > last_)
      thread.cpu_percent = kPercent * to_seconds(cpu[id] - before->second) / to_seconds(now - last_);
    threads[id] = std::move(thread);
  }
  cpu_ = std::move(cpu);
  last_ = now;
  std::vector<thread_status_t> list;
  for (auto& [id, thread] : threads) list.push_back(std::move(thread));
  return list;
}

}  // namespace imuscope
