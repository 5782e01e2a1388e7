#include "tools/imuscope/top/view.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "base/calibration_levels.h"
#include "base/json_text.h"
#include "base/text.h"
#include "base/units.h"

namespace imuscope::top {

namespace {

constexpr double kUsPerMs = 1e3;
constexpr double kBytesPerMb = 1e6;
constexpr double kPercent = 100.0;

/// A number with its decimals, or a dash where it is not known.
std::string number(double value, int decimals) {
  return std::isfinite(value) ? fmt::format("{:.{}f}", value, decimals) : "-";
}

/// Three digits, whatever the size.
std::string brief(double value) { return std::isfinite(value) ? fmt::format("{:.3g}", value) : "-"; }

std::string clock_of(double seconds) {
  const auto s = static_cast<std::int64_t>(seconds);
  return fmt::format("{}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60);
}

std::string against_goal(double sd, double goal, double unit, int decimals) {
  return fmt::format("{}/{}", number(sd * unit, decimals), brief(goal * unit));
}

void add_head(const Heard& heard, const status_t& status, std::vector<std::string>& lines) {
  lines.push_back(
      fmt::format("imuscope {}  run '{}'  {}: {}", status.version, status.run, status.state, status.reason));
  if (heard.status_age_s > kSilent_s) {
    lines.push_back(fmt::format("!! silent for {:.0f} s: what follows is old", heard.status_age_s));
  }
  lines.push_back(
      fmt::format("up {}  tick {}  memory {:.1f} MB  refits {}{}", clock_of(status.uptime_s), status.tick,
                  status.resident_memory_mb, status.refits,
                  status.refits > 0 ? fmt::format(" (last {:.0f} ms)", status.refit_duration_s * 1e3) : ""));
  lines.push_back(status.capture_path.empty()
                      ? "not recording"
                      : fmt::format("recording {}  {:.1f} MB  lost {}", status.capture_path,
                                    static_cast<double>(status.capture_bytes) / kBytesPerMb,
                                    status.capture_lost));
  if (!status.last_event.empty()) lines.push_back("last event: " + status.last_event);
}

/// What is wrong now, with what to do; then what was, shortly.
void add_alarms(const status_t& status, std::vector<std::string>& lines) {
  if (status.alarms.empty()) return;
  lines.emplace_back();
  lines.emplace_back("ALARMS");
  for (const auto& a : status.alarms) {
    const std::string often = a.times > 1 ? fmt::format(", {} times", a.times) : "";
    const auto since =
        status.utime > 0 && a.since_utime > 0
            ? fmt::format(
                  ", began {} ago",
                  clock_of(std::chrono::duration<double>(std::chrono::microseconds(std::max<std::int64_t>(
                                                             0, status.utime - a.since_utime)))
                               .count()))
            : "";
    if (a.active != 0) {
      lines.push_back(fmt::format("!! {} (for {}{})", a.what, clock_of(a.lasted_s), often));
      if (!a.remedy.empty()) lines.push_back("   " + a.remedy);
    } else {
      lines.push_back(fmt::format("   over: {} (lasted {}{}{})", a.what, clock_of(a.lasted_s), since, often));
    }
  }
}

void add_devices(const status_t& status, std::vector<std::string>& lines) {
  lines.emplace_back();
  lines.push_back(fmt::format("{:<12}{:<11}{:<13}{:>7}{:>7}{:>8}{:>6}{:>6}{:>9}{:>9}{:>12}{:>11}{:>11}",
                              "DEVICE", "role", "state", "rate/Hz", "age/s", "lost", "late", "bad", "refused",
                              "dropped", "latency/ms", "clock/us", "drift/ppm"));
  for (const auto& d : status.devices) {
    lines.push_back(fmt::format("{:<12}{:<11}{:<13}{:>7}{:>7}{:>8}{:>6}{:>6}{:>9}{:>9}{:>12}{:>11}{:>11}",
                                d.name, d.role, d.state, number(d.rate_hz, 1), number(d.data_age_s, 1),
                                d.samples_lost, d.samples_late, d.bad_checksums, d.samples_refused,
                                d.frames_dropped, number(d.latency_ms, 2), number(d.clock_sd_us, 0),
                                number(d.clock_drift_ppm, 1)));
    if (!d.problem.empty()) lines.push_back("  " + d.problem);
  }
}

/// What the mounting is good for as it is known now, on the scale of console and report; nothing where it is
/// not known.
std::string usability_text(const study_status_t& study) {
  if (!std::isfinite(study.sd_psi_deg) || !std::isfinite(study.sd_r_m)) return {};
  return std::string(
      words_of(usability_of(study.sd_psi_deg * kRadPerDeg, study.sd_r_m, study.sd_t_d_ms / kMsPerS)));
}

void add_studies(const Heard& heard, const status_t& status, std::vector<std::string>& lines) {
  lines.emplace_back();
  lines.push_back(fmt::format("{:<12}{:<26}{:>17}{:>16}{:>16}   {}", "CALIBRATION", "state", "boresight/deg",
                              "lever arm/mm", "t_d/ms", "(sd/goal)"));
  for (const auto& s : status.studies) {
    lines.push_back(fmt::format(
        "{:<12}{:<26}{:>17}{:>16}{:>16}   {:<10}{}", s.name, s.state,
        against_goal(s.sd_psi_deg, s.goal_psi_deg, 1.0, 4), against_goal(s.sd_r_m, s.goal_r_m, kMmPerM, 2),
        against_goal(s.sd_t_d_ms, s.goal_t_d_ms, 1.0, 3), s.regime, usability_text(s)));
    const auto found = heard.calibrations.find(s.name);
    if (found != heard.calibrations.end()) {
      const auto& c = found->second;
      lines.push_back(fmt::format(
          "  psi {:+.3f} {:+.3f} {:+.3f} deg  r {:+.1f} {:+.1f} {:+.1f} mm  t_d {:+.2f} ms", c.psi_x_deg,
          c.psi_y_deg, c.psi_z_deg, c.r_x_m * kMmPerM, c.r_y_m * kMmPerM, c.r_z_m * kMmPerM, c.t_d_ms));
    }
    if (s.manoeuvre.empty()) continue;
    lines.push_back(s.weakest.empty()
                        ? fmt::format("  still missing: {}", s.manoeuvre)
                        : fmt::format("  weakest {} ({} % of its prior left); still missing: {}", s.weakest,
                                      number(s.weakest_relative * kPercent, 0), s.manoeuvre));
  }
}

nlohmann::json known(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr);
}

void add_odometry(const Heard& heard, std::vector<std::string>& lines) {
  if (!heard.odometry) return;
  const odometry_t& o = *heard.odometry;
  const char* state = "rolling";
  if (o.lost != 0) {
    state = "lost: no speed comes";
  } else if (o.zero_velocity != 0) {
    state = "at rest, zero velocity in use";
  } else if (o.standing != 0) {
    state = "standing";
  }
  lines.emplace_back();
  lines.push_back(
      fmt::format("ODOMETRY    {:+.2f} m/s  {}  scale {:+.2f} sd {:.2f} %  mounting {:+.2f} {:+.2f} deg",
                  o.speed_mps, state, o.scale_percent, o.sd_scale_percent, o.mount_y_deg, o.mount_z_deg));
  lines.push_back(fmt::format("  used/rejected: speed {}/{}  no slip {}/{}  zero velocity {}/{}",
                              o.speed_used, o.speed_rejected, o.non_holonomic_used, o.non_holonomic_rejected,
                              o.zero_velocity_used, o.zero_velocity_rejected));
}

/// The mean error of the newest message's rows: gyro, then accelerometer.
std::array<double, 6> mean_error(const virtual_imu_t& imu) {
  std::array<double, 6> sum{};
  for (const auto& row : imu.rows) {
    const std::array error{row.e_gyro_x_radps, row.e_gyro_y_radps, row.e_gyro_z_radps,
                           row.e_accel_x_mps2, row.e_accel_y_mps2, row.e_accel_z_mps2};
    for (std::size_t i = 0; i < error.size(); ++i) sum[i] += error[i];
  }
  for (double& value : sum) value /= static_cast<double>(imu.rows.size());
  return sum;
}

std::string_view state_of(const virtual_imu_t& imu) {
  switch (imu.validity) {
    case virtual_imu_t::USABLE:
      return "usable";
    case virtual_imu_t::CONVERGING:
      return "converging: a mounting is not known well enough yet";
    case virtual_imu_t::CONTRADICTED:
      return "contradicted: an IMU does not fit the reference";
    default:
      return "stale: the reference is silent";
  }
}

void add_virtual_imu(const Heard& heard, std::vector<std::string>& lines) {
  if (!heard.virtual_imu) return;
  const virtual_imu_t& imu = *heard.virtual_imu;
  const bool is_silent = heard.virtual_imu_age_s > kSilent_s;
  lines.emplace_back();
  lines.push_back(
      fmt::format("VIRTUAL     of {}  {}", fmt::join(imu.imus, ", "),
                  is_silent ? "silent: one of its IMUs has no samples or no mounting" : state_of(imu)));
  if (is_silent) return;
  const auto e = mean_error(imu);
  lines.push_back(fmt::format("  error {} {} {} deg/s  {} {} {} m/s2  rows missing {}",
                              brief(e[0] * kDegPerRad), brief(e[1] * kDegPerRad), brief(e[2] * kDegPerRad),
                              brief(e[3]), brief(e[4]), brief(e[5]), imu.missing));
}

nlohmann::json virtual_imu_json(const virtual_imu_t& imu) {
  const auto e = mean_error(imu);
  return {{"utime", imu.utime},
          {"imus", imu.imus},
          {"validity", imu.validity},
          {"missing", imu.missing},
          {"e_gyro_radps", {known(e[0]), known(e[1]), known(e[2])}},
          {"e_accel_mps2", {known(e[3]), known(e[4]), known(e[5])}}};
}

nlohmann::json odometry_json(const odometry_t& o) {
  return {{"speed_mps", known(o.speed_mps)},
          {"standing", o.standing != 0},
          {"zero_velocity", o.zero_velocity != 0},
          {"lost", o.lost != 0},
          {"scale_percent", known(o.scale_percent)},
          {"sd_scale_percent", known(o.sd_scale_percent)},
          {"speed_used", o.speed_used},
          {"speed_rejected", o.speed_rejected},
          {"non_holonomic_used", o.non_holonomic_used},
          {"non_holonomic_rejected", o.non_holonomic_rejected},
          {"zero_velocity_used", o.zero_velocity_used},
          {"zero_velocity_rejected", o.zero_velocity_rejected}};
}

std::string model_line(const axis_noise_model_t& model) {
  std::string text = fmt::format("  {:<8} {:<8} {:<10}", model.axis, model.regime, model.model);
  for (const auto& p : model.parameters) text += fmt::format("  {} {} {}", p.process, p.name, brief(p.value));
  if (!model.identifiable) text += "  (not identifiable)";
  return text;
}

/// Gyroscopes alone: the picture has to fit a terminal; the messages hold the rest.
void add_models(const Heard& heard, std::vector<std::string>& lines) {
  if (heard.models.empty()) return;
  lines.emplace_back();
  lines.emplace_back("NOISE MODELS of the gyroscopes, newest refit");
  for (const auto& [name, message] : heard.models) {
    lines.push_back(fmt::format("{}  at {:.0f} s", name, message.time_s));
    for (const auto& model : message.models) {
      if (model.axis.starts_with("gyro")) lines.push_back(model_line(model));
    }
  }
}

std::string ms_or_us(double us) {
  if (!std::isfinite(us)) return "-";
  return us < kUsPerMs ? fmt::format("{:.0f} us", us) : fmt::format("{:.1f} ms", us / kUsPerMs);
}

void add_threads(const status_t& status, std::vector<std::string>& lines) {
  lines.emplace_back();
  lines.push_back(fmt::format("{:<16}{:<9}{:>6}{:>8}{:>9}{:>9}{:>8}{:>10}{:>10}{:>10}{:>10}{:>10}{:>10}",
                              "THREAD", "sched", "cpu/%", "alive/s", "ticks", "overruns", "skipped",
                              "late p50", "p99", "p99.9", "max", "done p50", "p99"));
  for (const auto& t : status.threads) {
    lines.push_back(fmt::format(
        "{:<16}{:<9}{:>6}{:>8}{:>9}{:>9}{:>8}{:>10}{:>10}{:>10}{:>10}{:>10}{:>10}", t.name, t.scheduling,
        number(t.cpu_percent, 2), number(t.heartbeat_age_s, 1), t.ticks, t.overruns, t.skipped,
        ms_or_us(t.lateness_p50_us), ms_or_us(t.lateness_p99_us), ms_or_us(t.lateness_p999_us),
        ms_or_us(t.lateness_max_us), ms_or_us(t.done_p50_us), ms_or_us(t.done_p99_us)));
  }
  for (const auto& t : status.threads) {
    if (t.lateness_octaves.empty()) continue;
    lines.push_back(
        fmt::format("{:<16}1 us |{}| {:.0f} ms and more: wake-ups by lateness, octaves, log scale", t.name,
                    histogram_bars(t.lateness_octaves),
                    1.024e-3 * std::exp2(static_cast<double>(t.lateness_octaves.size()) - 2.0)));
  }
}

void add_rings(const status_t& status, std::vector<std::string>& lines) {
  lines.emplace_back();
  lines.push_back(
      fmt::format("{:<16}{:>9}{:>7}{:>12}{:>9}", "RING", "capacity", "level", "high water", "refused"));
  for (const auto& r : status.rings) {
    lines.push_back(
        fmt::format("{:<16}{:>9}{:>7}{:>12}{:>9}", r.name, r.capacity, r.level, r.high_water, r.refused));
  }
}

nlohmann::json device_json(const device_status_t& d) {
  return {{"name", d.name},
          {"role", d.role},
          {"protocol", d.protocol},
          {"state", d.state},
          {"problem", d.problem},
          {"data_age_s", known(d.data_age_s)},
          {"rate_hz", known(d.rate_hz)},
          {"bytes", d.bytes},
          {"bytes_skipped", d.bytes_skipped},
          {"frames", d.frames},
          {"samples", d.samples},
          {"samples_lost", d.samples_lost},
          {"samples_late", d.samples_late},
          {"samples_refused", d.samples_refused},
          {"frames_dropped", d.frames_dropped},
          {"bad_checksums", d.bad_checksums},
          {"clock_resets", d.clock_resets},
          {"latency_ms", known(d.latency_ms)},
          {"clock_sd_us", known(d.clock_sd_us)},
          {"clock_drift_ppm", known(d.clock_drift_ppm)},
          {"stamped_by", d.stamped_by},
          {"stamp_lead_us", known(d.stamp_lead_us)},
          {"stamp_lead_sd_us", known(d.stamp_lead_sd_us)},
          {"wire_ms", known(d.wire_ms)},
          {"adapter_ms", known(d.adapter_ms)},
          {"t_d_ms", known(d.t_d_ms)},
          {"sd_t_d_ms", known(d.sd_t_d_ms)},
          {"delay_ms", known(d.delay_ms)},
          {"sd_delay_ms", known(d.sd_delay_ms)}};
}

nlohmann::json study_json(const study_status_t& s) {
  return {{"name", s.name},
          {"state", s.state},
          {"regime", s.regime},
          {"sd_psi_deg", known(s.sd_psi_deg)},
          {"goal_psi_deg", known(s.goal_psi_deg)},
          {"sd_r_m", known(s.sd_r_m)},
          {"goal_r_m", known(s.goal_r_m)},
          {"sd_t_d_ms", known(s.sd_t_d_ms)},
          {"goal_t_d_ms", known(s.goal_t_d_ms)},
          {"weakest", s.weakest},
          {"weakest_relative", known(s.weakest_relative)},
          {"manoeuvre", s.manoeuvre}};
}

nlohmann::json thread_json(const thread_status_t& t) {
  return {{"name", t.name},
          {"scheduling", t.scheduling},
          {"cpu_percent", known(t.cpu_percent)},
          {"heartbeat_age_s", known(t.heartbeat_age_s)},
          {"ticks", t.ticks},
          {"overruns", t.overruns},
          {"skipped", t.skipped},
          {"lateness_us",
           {{"p50", known(t.lateness_p50_us)},
            {"p99", known(t.lateness_p99_us)},
            {"p99.9", known(t.lateness_p999_us)},
            {"max", known(t.lateness_max_us)}}},
          {"done_us",
           {{"p50", known(t.done_p50_us)},
            {"p99", known(t.done_p99_us)},
            {"p99.9", known(t.done_p999_us)},
            {"max", known(t.done_max_us)}}}};
}

nlohmann::json ring_json(const ring_status_t& r) {
  return {{"name", r.name},
          {"capacity", r.capacity},
          {"level", r.level},
          {"high_water", r.high_water},
          {"refused", r.refused}};
}

nlohmann::json alarm_json(const alarm_t& a) {
  return {{"kind", a.kind},         {"subject", a.subject},    {"what", a.what},
          {"remedy", a.remedy},     {"active", a.active != 0}, {"since_utime", a.since_utime},
          {"lasted_s", a.lasted_s}, {"times", a.times}};
}

}  // namespace

std::string histogram_bars(const std::vector<std::int64_t>& octaves) {
  constexpr std::array kBars{" ", "▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"};
  const std::int64_t most = octaves.empty() ? 0 : *std::max_element(octaves.begin(), octaves.end());
  std::string bars;
  for (const std::int64_t count : octaves) {
    std::size_t height = 0;
    if (count > 0) {
      const double share = std::log1p(static_cast<double>(count)) / std::log1p(static_cast<double>(most));
      height = static_cast<std::size_t>(std::lround(1.0 + share * static_cast<double>(kBars.size() - 2)));
    }
    bars += kBars[height];
  }
  return bars;
}

std::vector<std::string> lines_of(const Heard& heard) {
  std::vector<std::string> lines;
  if (!heard.status) {
    lines.emplace_back(
        "no service has been heard yet: is `imuscope run` running, and on the same --lcm URL?");
  } else {
    const status_t& status = *heard.status;
    add_head(heard, status, lines);
    add_alarms(status, lines);
    add_devices(status, lines);
    add_studies(heard, status, lines);
    add_odometry(heard, lines);
    add_virtual_imu(heard, lines);
    add_threads(status, lines);
    add_rings(status, lines);
    add_models(heard, lines);
  }
  if (!heard.note.empty()) {
    lines.emplace_back();
    lines.push_back(heard.note);
  }
  for (std::string& line : lines) line = printable(line);
  return lines;
}

std::string json_of(const Heard& heard) {
  const status_t& s = heard.status.value();
  nlohmann::json json{{"run", s.run},
                      {"version", s.version},
                      {"build", s.build},
                      {"configuration_hash", s.configuration_hash},
                      {"state", s.state},
                      {"reason", s.reason},
                      {"status_age_s", heard.status_age_s},
                      {"uptime_s", s.uptime_s},
                      {"tick", s.tick},
                      {"refits", s.refits},
                      {"refit_duration_s", known(s.refit_duration_s)},
                      {"resident_memory_mb", s.resident_memory_mb},
                      {"capture_path", s.capture_path},
                      {"capture_bytes", s.capture_bytes},
                      {"capture_lost", s.capture_lost},
                      {"last_event", s.last_event},
                      {"devices", nlohmann::json::array()},
                      {"studies", nlohmann::json::array()},
                      {"threads", nlohmann::json::array()},
                      {"rings", nlohmann::json::array()},
                      {"alarms", nlohmann::json::array()}};
  if (heard.odometry) json["odometry"] = odometry_json(*heard.odometry);
  if (heard.virtual_imu) json["virtual_imu"] = virtual_imu_json(*heard.virtual_imu);
  for (const auto& device : s.devices) json["devices"].push_back(device_json(device));
  for (const auto& study : s.studies) json["studies"].push_back(study_json(study));
  for (const auto& thread : s.threads) json["threads"].push_back(thread_json(thread));
  for (const auto& ring : s.rings) json["rings"].push_back(ring_json(ring));
  for (const auto& alarm : s.alarms) json["alarms"].push_back(alarm_json(alarm));
  return json_text(json);
}

}  // namespace imuscope::top
