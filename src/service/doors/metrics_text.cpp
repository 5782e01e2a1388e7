#include "service/doors/metrics_text.h"

#include <fmt/format.h>
#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <set>
#include <string_view>
#include <utility>

#include "base/contracts.h"
#include "base/text.h"
#include "base/units.h"

namespace imuscope {

namespace {

constexpr double kSPerMs = 1e-3;
constexpr double kSPerUs = 1e-6;
constexpr double kPerPpm = 1e-6;
constexpr double kPerPercent = 1e-2;
constexpr double kBytesPerMb = 1e6;
constexpr std::array kStates{"starting", "aligning", "running", "degraded", "failed"};

constexpr std::array kFamilies{
    MetricFamily{"imuscope_info", "gauge", "run, version, build", "1; what runs."},
    MetricFamily{"imuscope_state", "gauge", "state",
                 "1 for the state that the service is in: starting, aligning, running, degraded, failed."},
    MetricFamily{"imuscope_uptime_seconds", "gauge", "", "Since the run began."},
    MetricFamily{
        "imuscope_status_age_seconds", "gauge", "",
        "Since these numbers were made, once a second; more than a few: the publisher stands still."},
    MetricFamily{"imuscope_ticks_total", "counter", "", "100 Hz ticks of the estimator."},
    MetricFamily{"imuscope_resident_memory_bytes", "gauge", "", "Of the service."},
    MetricFamily{"imuscope_refits_total", "counter", "", "Noise models that were fitted anew."},
    MetricFamily{"imuscope_capture_bytes_total", "counter", "", "Recorded."},
    MetricFamily{"imuscope_capture_lost_records_total", "counter", "", "Records that could not be kept."},
    MetricFamily{"imuscope_utc_sd_seconds", "gauge", "source",
                 "Standard deviation of UTC, with who tells it: reference, gnss, pc, none."},
    MetricFamily{"imuscope_alarm_active", "gauge", "kind, subject",
                 "1 while the alarm is on, 0 when it is over."},
    MetricFamily{"imuscope_alarm_begins_total", "counter", "kind, subject", "How often the alarm has begun."},
    MetricFamily{"imuscope_device_streaming", "gauge", "device, role", "1 while samples come."},
    MetricFamily{"imuscope_device_data_age_seconds", "gauge", "device", "Since the newest sample was read."},
    MetricFamily{"imuscope_device_rate_hertz", "gauge", "device", "Samples in the last second."},
    MetricFamily{"imuscope_device_latency_seconds", "gauge", "device",
                 "From the time of validity to the read, mean over the last second."},
    MetricFamily{"imuscope_device_clock_drift_ratio", "gauge", "device",
                 "Of the device's clock against this PC's, fast where positive."},
    MetricFamily{"imuscope_device_read_bytes_total", "counter", "device", "Read from the line."},
    MetricFamily{"imuscope_device_skipped_bytes_total", "counter", "device", "Belonged to no valid frame."},
    MetricFamily{"imuscope_device_frames_total", "counter", "device", "Valid wire frames."},
    MetricFamily{"imuscope_device_dropped_frames_total", "counter", "device",
                 "Lost by this PC before they were read."},
    MetricFamily{"imuscope_device_bad_checksums_total", "counter", "device", "Frames with a wrong checksum."},
    MetricFamily{"imuscope_device_samples_total", "counter", "device", "Decoded."},
    MetricFamily{"imuscope_device_lost_samples_total", "counter", "device",
                 "Missing by the device's own count."},
    MetricFamily{"imuscope_device_late_samples_total", "counter", "device",
                 "Of an S-IMU: the reference came too late for them."},
    MetricFamily{"imuscope_device_refused_samples_total", "counter", "device", "Found their ring full."},
    MetricFamily{"imuscope_device_clock_resets_total", "counter", "device", "The device counted anew."},
    MetricFamily{"imuscope_study_state", "gauge", "imu, state",
                 "1 for the state of each S-IMU's calibration."},
    MetricFamily{"imuscope_study_boresight_sd_degrees", "gauge", "imu", "Largest of three axes."},
    MetricFamily{"imuscope_study_lever_arm_sd_meters", "gauge", "imu", "Largest of three axes."},
    MetricFamily{"imuscope_study_time_offset_sd_seconds", "gauge", "imu", "Of the constant delay."},
    MetricFamily{"imuscope_thread_heartbeat_age_seconds", "gauge", "thread",
                 "Since the thread's last sign of life."},
    MetricFamily{"imuscope_thread_cpu_ratio", "gauge", "thread",
                 "Of one processor core, over the last second."},
    MetricFamily{"imuscope_thread_ticks_total", "counter", "thread", "Deadlines met with work."},
    MetricFamily{"imuscope_thread_overruns_total", "counter", "thread",
                 "Ticks that went past the next deadline."},
    MetricFamily{"imuscope_thread_skipped_ticks_total", "counter", "thread",
                 "Ticks that were never delivered."},
    MetricFamily{"imuscope_thread_lateness_p99_seconds", "gauge", "thread",
                 "Wake-up after the deadline, 99 % since the start."},
    MetricFamily{"imuscope_thread_lateness_max_seconds", "gauge", "thread",
                 "Wake-up after the deadline, the worst since the start."},
    MetricFamily{"imuscope_ring_capacity", "gauge", "ring", "Elements, of the raw ring bytes."},
    MetricFamily{"imuscope_ring_level", "gauge", "ring", "Waiting now."},
    MetricFamily{"imuscope_ring_high_water", "gauge", "ring", "Most that ever waited together."},
    MetricFamily{"imuscope_ring_refused_total", "counter", "ring", "Lost because the ring was full."},
};

using Labels = std::initializer_list<std::pair<std::string_view, std::string_view>>;

/// As the format wants the value of a label.
std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : printable(text)) {
    if (c == '\\' || c == '"') out += '\\';
    out += c;
  }
  return out;
}

std::string number(double value) { return std::isnan(value) ? "NaN" : fmt::format("{}", value); }

/// Writes family by family in the order of kFamilies.
class Page {
 public:
  void begin(std::string_view name) {
    IMUSCOPE_EXPECTS(next_ < kFamilies.size() && name == kFamilies[next_].name);
    family_ = &kFamilies[next_++];
    seen_.clear();
    text_ += fmt::format("# HELP {0} {1}\n# TYPE {0} {2}\n", family_->name, family_->help, family_->type);
  }
  void add(double value, Labels labels = {}) {
    std::string inner;
    for (const auto& [name, label] : labels)
      inner += fmt::format("{}{}=\"{}\"", inner.empty() ? "" : ",", name, escaped(label));
    // A set of labels stands once: threads may share their name.
    if (!seen_.insert(inner).second) return;
    text_ += inner.empty() ? fmt::format("{} {}\n", family_->name, number(value))
                           : fmt::format("{}{{{}}} {}\n", family_->name, inner, number(value));
  }
  void add(std::int64_t value, Labels labels = {}) { add(static_cast<double>(value), labels); }
  void only(std::string_view name, double value) {
    begin(name);
    add(value);
  }
  /// One value an element.
  template <typename List, typename Value>
  void each(std::string_view name, const List& list, std::string_view label, Value&& value) {
    begin(name);
    for (const auto& element : list) add(value(element), {{label, element.name}});
  }
  [[nodiscard]] std::string take() {
    IMUSCOPE_EXPECTS(next_ == kFamilies.size());
    return std::move(text_);
  }

 private:
  std::string text_;
  std::size_t next_ = 0;
  const MetricFamily* family_ = nullptr;
  std::set<std::string> seen_;
};

void add_run(const status_t& s, double age_s, Page& page) {
  page.begin("imuscope_info");
  page.add(1.0, {{"run", s.run}, {"version", s.version}, {"build", s.build}});
  page.begin("imuscope_state");
  for (const char* state : kStates) page.add(s.state == state ? 1.0 : 0.0, {{"state", state}});
  page.only("imuscope_uptime_seconds", s.uptime_s);
  page.only("imuscope_status_age_seconds", age_s);
  page.only("imuscope_ticks_total", static_cast<double>(s.tick + 1));
  page.only("imuscope_resident_memory_bytes", s.resident_memory_mb * kBytesPerMb);
  page.only("imuscope_refits_total", static_cast<double>(s.refits));
  page.only("imuscope_capture_bytes_total", static_cast<double>(s.capture_bytes));
  page.only("imuscope_capture_lost_records_total", static_cast<double>(s.capture_lost));
  page.begin("imuscope_utc_sd_seconds");
  page.add(s.utc_sd_s, {{"source", s.utc_source}});
  page.begin("imuscope_alarm_active");
  for (const auto& a : s.alarms)
    page.add(a.active != 0 ? 1.0 : 0.0, {{"kind", a.kind}, {"subject", a.subject}});
  page.begin("imuscope_alarm_begins_total");
  for (const auto& a : s.alarms) page.add(a.times, {{"kind", a.kind}, {"subject", a.subject}});
}

void add_devices(const status_t& s, Page& page) {
  page.begin("imuscope_device_streaming");
  for (const auto& d : s.devices)
    page.add(d.state == "streaming" ? 1.0 : 0.0, {{"device", d.name}, {"role", d.role}});
  const auto each = [&](std::string_view name, auto value) { page.each(name, s.devices, "device", value); };
  each("imuscope_device_data_age_seconds", [](const auto& d) { return d.data_age_s; });
  each("imuscope_device_rate_hertz", [](const auto& d) { return d.rate_hz; });
  each("imuscope_device_latency_seconds", [](const auto& d) { return d.latency_ms * kSPerMs; });
  each("imuscope_device_clock_drift_ratio", [](const auto& d) { return d.clock_drift_ppm * kPerPpm; });
  each("imuscope_device_read_bytes_total", [](const auto& d) { return d.bytes; });
  each("imuscope_device_skipped_bytes_total", [](const auto& d) { return d.bytes_skipped; });
  each("imuscope_device_frames_total", [](const auto& d) { return d.frames; });
  each("imuscope_device_dropped_frames_total", [](const auto& d) { return d.frames_dropped; });
  each("imuscope_device_bad_checksums_total", [](const auto& d) { return d.bad_checksums; });
  each("imuscope_device_samples_total", [](const auto& d) { return d.samples; });
  each("imuscope_device_lost_samples_total", [](const auto& d) { return d.samples_lost; });
  each("imuscope_device_late_samples_total", [](const auto& d) { return d.samples_late; });
  each("imuscope_device_refused_samples_total", [](const auto& d) { return d.samples_refused; });
  each("imuscope_device_clock_resets_total", [](const auto& d) { return d.clock_resets; });
}

void add_studies(const status_t& s, Page& page) {
  page.begin("imuscope_study_state");
  for (const auto& study : s.studies) page.add(1.0, {{"imu", study.name}, {"state", study.state}});
  const auto each = [&](std::string_view name, auto value) { page.each(name, s.studies, "imu", value); };
  each("imuscope_study_boresight_sd_degrees", [](const auto& study) { return study.sd_psi_deg; });
  each("imuscope_study_lever_arm_sd_meters", [](const auto& study) { return study.sd_r_m; });
  each("imuscope_study_time_offset_sd_seconds", [](const auto& study) { return study.sd_t_d_ms * kSPerMs; });
}

void add_threads_and_rings(const status_t& s, Page& page) {
  const auto thread = [&](std::string_view name, auto value) { page.each(name, s.threads, "thread", value); };
  thread("imuscope_thread_heartbeat_age_seconds", [](const auto& t) { return t.heartbeat_age_s; });
  thread("imuscope_thread_cpu_ratio", [](const auto& t) { return t.cpu_percent * kPerPercent; });
  thread("imuscope_thread_ticks_total", [](const auto& t) { return t.ticks; });
  thread("imuscope_thread_overruns_total", [](const auto& t) { return t.overruns; });
  thread("imuscope_thread_skipped_ticks_total", [](const auto& t) { return t.skipped; });
  thread("imuscope_thread_lateness_p99_seconds", [](const auto& t) { return t.lateness_p99_us * kSPerUs; });
  thread("imuscope_thread_lateness_max_seconds", [](const auto& t) { return t.lateness_max_us * kSPerUs; });
  const auto ring = [&](std::string_view name, auto value) { page.each(name, s.rings, "ring", value); };
  ring("imuscope_ring_capacity", [](const auto& r) { return r.capacity; });
  ring("imuscope_ring_level", [](const auto& r) { return r.level; });
  ring("imuscope_ring_high_water", [](const auto& r) { return r.high_water; });
  ring("imuscope_ring_refused_total", [](const auto& r) { return r.refused; });
}

}  // namespace

std::span<const MetricFamily> metric_families() { return kFamilies; }

std::string metrics_text(const status_t& status, double age_s) {
  Page page;
  add_run(status, age_s, page);
  add_devices(status, page);
  add_studies(status, page);
  add_threads_and_rings(status, page);
  return page.take();
}

}  // namespace imuscope
