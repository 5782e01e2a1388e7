#include "service/health.h"

#include <fmt/format.h>
#include <sched.h>
#include <algorithm>
#include <array>
#include <charconv>
#include <filesystem>
#include <fstream>

#include "service/observability.h"

namespace imuscope {

namespace {

constexpr std::string_view kReference = "reference";
constexpr std::string_view kStudy = "study";
/// The coarse mounting comes from the rates of both IMUs about more than one axis.
constexpr const char* kManoeuvreForMounting =
    "turn both ways: figures of eight or roundabouts at 20 to 30 deg/s";

bool streams(const StatusReport::Device& device) { return device.state == "streaming"; }

std::string device_reason(const StatusReport::Device& device) {
  return device.problem.empty() ? fmt::format("{}: {}", device.name, device.state)
                                : fmt::format("{}: {}: {}", device.name, device.state, device.problem);
}

/// Something is being lost, though every device streams; empty when nothing is.
std::string loss_reason(const StatusReport& report) {
  if (report.capture_lost > 0)
    return fmt::format("{} records could not be kept in the capture", report.capture_lost);
  for (const auto& ring : report.rings) {
    if (ring.refused > 0) return fmt::format("the ring '{}' refused {} elements", ring.name, ring.refused);
  }
  for (const auto& device : report.devices) {
    if (device.frames_dropped > 0)
      return fmt::format("{} frames of {} were lost by this PC before they could be read",
                         device.frames_dropped, device.name);
    if (device.samples_refused > 0)
      return fmt::format("{} samples of {} found their ring full", device.samples_refused, device.name);
  }
  return {};
}

}  // namespace

Health judge(const StatusReport& report) {
  const auto& devices = report.devices;
  const auto failed = [](const StatusReport::Device& device) { return device.state == "failed"; };
  const auto find = [&](auto condition) { return std::find_if(devices.begin(), devices.end(), condition); };

  if (const auto reference = find([&](const auto& d) { return d.role == kReference && failed(d); });
      reference != devices.end()) {
    return {"failed", device_reason(*reference)};
  }
  const bool any_study = std::any_of(devices.begin(), devices.end(),
                                     [&](const auto& d) { return d.role == kStudy && !failed(d); });
  if (!any_study && !devices.empty()) return {"failed", "no IMU under study can be set up"};

  const bool calibrating = std::any_of(report.studies.begin(), report.studies.end(), [](const auto& study) {
    return study.state == name_of(StudyStatus::kConverging) ||
           study.state == name_of(StudyStatus::kCalibrated);
  });
  if (const auto silent = find([](const auto& d) { return !streams(d); }); silent != devices.end()) {
    return {calibrating || failed(*silent) ? "degraded" : "starting", device_reason(*silent)};
  }
  if (auto loss = loss_reason(report); !loss.empty()) return {"degraded", std::move(loss)};
  if (!report.problems.empty()) return {"degraded", report.problems.front()};
  if (!calibrating) return {"aligning", "waiting for motion that shows how the S-IMUs sit"};
  return {"running", "all devices stream"};
}

const char* name_of(StudyStatus status) {
  switch (status) {
    case StudyStatus::kWaiting:
      return "waiting for samples";
    case StudyStatus::kCoarse:
      return "looking for its mounting";
    case StudyStatus::kConverging:
      return "converging";
    case StudyStatus::kCalibrated:
      break;
  }
  return "calibrated";
}

StatusReport::Study study_status(const std::string& name, const StudyOutput& study,
                                 const StudyConfig& config) {
  const auto largest = [](const Vector3& sd) { return *std::max_element(sd.begin(), sd.end()); };
  StatusReport::Study status;
  status.name = name;
  status.state = name_of(study.status);
  status.regime = regime_name(study.regime);
  status.goal_psi_rad = config.goal_boresight_sd_rad;
  status.goal_r_m = config.goal_r_bs_b_sd_m;
  status.goal_t_d_s = config.goal_t_d_sd_s;
  status.samples = study.counters.samples;
  status.used = study.counters.used;
  status.late = study.counters.late;
  for (std::size_t i = 0; i < 3; ++i)
    status.gated += study.counters.gated_gyro[i] + study.counters.gated_accel[i];
  const bool has_estimate =
      study.status == StudyStatus::kConverging || study.status == StudyStatus::kCalibrated;
  if (!has_estimate) {
    status.manoeuvre = kManoeuvreForMounting;
    return status;
  }
  const auto observability = observability_of(study);
  status.sd_psi_rad = largest(study.sd_psi_rad);
  status.sd_r_m = largest(study.sd_r_bs_b_m);
  status.sd_t_d_s = study.sd_t_d_s;
  status.weakest = observability.weakest;
  status.weakest_relative = observability.weakest_relative_sd;
  status.manoeuvre = observability.advice;
  return status;
}

StatusReport::Quantiles quantiles_of(const LatenessHistogram& histogram) {
  if (histogram.count() == 0) return {};
  return {to_seconds(histogram.quantile(0.5)), to_seconds(histogram.quantile(0.99)),
          to_seconds(histogram.quantile(0.999)), to_seconds(histogram.max())};
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

std::vector<StatusReport::Thread> ThreadWatch::look(HostTime now) {
  std::map<int, StatusReport::Thread> threads;
  std::map<int, Duration> cpu;
  std::error_code vanished;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/task", vanished)) {
    const std::string id_text = entry.path().filename().string();
    int id = 0;
    std::from_chars(id_text.data(), id_text.data() + id_text.size(), id);
    StatusReport::Thread thread;
    std::ifstream(entry.path() / "comm") >> thread.name;
    std::int64_t ran_ns = 0;
    std::ifstream(entry.path() / "schedstat") >> ran_ns;
    thread.scheduling = scheduling_of(id);
    cpu[id] = Duration{ran_ns};
    const auto before = cpu_.find(id);
    if (before != cpu_.end() && now > last_)
      thread.cpu_share = to_seconds(cpu[id] - before->second) / to_seconds(now - last_);
    threads[id] = std::move(thread);
  }
  cpu_ = std::move(cpu);
  last_ = now;
  std::vector<StatusReport::Thread> list;
  for (auto& [id, thread] : threads) list.push_back(std::move(thread));
  return list;
}

}  // namespace imuscope
