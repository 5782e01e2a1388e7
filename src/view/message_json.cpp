#include "view/message_json.h"

#include <fmt/format.h>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <vector>

#include "base/text.h"

namespace imuscope::view {

namespace {

using nlohmann::json;

json known(double value) { return std::isfinite(value) ? json(value) : json(nullptr); }

/// Six significant digits: JSON writes a double with as many as tell it from its neighbours, and a page
/// shows four.
json brief(double value) {
  if (!std::isfinite(value)) return nullptr;
  constexpr int kDigits = 6;
  return std::strtod(fmt::format("{:.{}g}", value, kDigits).c_str(), nullptr);
}

json brief(const std::vector<double>& values) {
  json array = json::array();
  for (const double value : values) array.push_back(brief(value));
  return array;
}

json device_json(const device_status_t& d) {
  return {{"name", shown(d.name)},
          {"role", shown(d.role)},
          {"protocol", shown(d.protocol)},
          {"state", shown(d.state)},
          {"problem", shown(d.problem)},
          {"data_age_s", brief(d.data_age_s)},
          {"rate_hz", brief(d.rate_hz)},
          {"samples", d.samples},
          {"samples_lost", d.samples_lost},
          {"samples_late", d.samples_late},
          {"samples_refused", d.samples_refused},
          {"frames_dropped", d.frames_dropped},
          {"bad_checksums", d.bad_checksums},
          {"clock_resets", d.clock_resets},
          {"latency_ms", brief(d.latency_ms)},
          {"clock_sd_us", brief(d.clock_sd_us)},
          {"clock_drift_ppm", brief(d.clock_drift_ppm)}};
}

json study_json(const study_status_t& s) {
  return {{"name", shown(s.name)},
          {"state", shown(s.state)},
          {"regime", shown(s.regime)},
          {"sd_psi_deg", brief(s.sd_psi_deg)},
          {"goal_psi_deg", brief(s.goal_psi_deg)},
          {"sd_r_m", brief(s.sd_r_m)},
          {"goal_r_m", brief(s.goal_r_m)},
          {"sd_t_d_ms", brief(s.sd_t_d_ms)},
          {"goal_t_d_ms", brief(s.goal_t_d_ms)},
          {"weakest", shown(s.weakest)},
          {"weakest_relative", brief(s.weakest_relative)},
          {"manoeuvre", shown(s.manoeuvre)}};
}

json thread_json(const thread_status_t& t) {
  return {{"name", shown(t.name)},
          {"scheduling", shown(t.scheduling)},
          {"cpu_percent", brief(t.cpu_percent)},
          {"ticks", t.ticks},
          {"overruns", t.overruns},
          {"skipped", t.skipped},
          {"lateness_p50_us", brief(t.lateness_p50_us)},
          {"lateness_p99_us", brief(t.lateness_p99_us)},
          {"lateness_max_us", brief(t.lateness_max_us)},
          {"done_p99_us", brief(t.done_p99_us)},
          {"done_max_us", brief(t.done_max_us)}};
}

json ring_json(const ring_status_t& r) {
  return {{"name", shown(r.name)},
          {"capacity", r.capacity},
          {"high_water", r.high_water},
          {"refused", r.refused}};
}

json alarm_json(const alarm_t& a) {
  return {{"kind", shown(a.kind)},     {"subject", shown(a.subject)}, {"what", shown(a.what)},
          {"remedy", shown(a.remedy)}, {"active", a.active != 0},     {"lasted_s", brief(a.lasted_s)},
          {"times", a.times}};
}

template <typename List, typename ToJson>
json list_of(const List& list, ToJson&& one) {
  json array = json::array();
  for (const auto& element : list) array.push_back(one(element));
  return array;
}

}  // namespace

std::string shown(std::string_view text) { return one_line(text, kShownTextMax); }

void append_number(std::string& out, double value) {
  if (std::isfinite(value)) {
    fmt::format_to(std::back_inserter(out), "{:.4g}", value);
  } else {
    out += "null";
  }
}

json to_json(const status_t& s) {
  return {{"utime", s.utime},
          {"run", shown(s.run)},
          {"version", shown(s.version)},
          {"configuration_hash", shown(s.configuration_hash)},
          {"state", shown(s.state)},
          {"reason", shown(s.reason)},
          {"uptime_s", brief(s.uptime_s)},
          {"tick", s.tick},
          {"refits", s.refits},
          {"refit_duration_s", brief(s.refit_duration_s)},
          {"resident_memory_mb", brief(s.resident_memory_mb)},
          {"capture_path", shown(s.capture_path)},
          {"capture_bytes", s.capture_bytes},
          {"capture_lost", s.capture_lost},
          {"utc_source", shown(s.utc_source)},
          {"last_event", shown(s.last_event)},
          {"devices", list_of(s.devices, device_json)},
          {"studies", list_of(s.studies, study_json)},
          {"threads", list_of(s.threads, thread_json)},
          {"rings", list_of(s.rings, ring_json)},
          {"alarms", list_of(s.alarms, alarm_json)}};
}

json to_json(const calibration_t& c) {
  // Of the bits alone: psi, lever arm, time offset.
  const json observable = json::array({c.psi_x_observable != 0, c.psi_y_observable != 0,
                                       c.psi_z_observable != 0, c.r_x_observable != 0, c.r_y_observable != 0,
                                       c.r_z_observable != 0, c.t_d_observable != 0});
  return {{"time_s", known(c.time_s)},
          {"q", brief({c.q_w, c.q_x, c.q_y, c.q_z})},
          {"psi_deg", brief({c.psi_x_deg, c.psi_y_deg, c.psi_z_deg})},
          {"sd_psi_deg", brief({c.sd_psi_x_deg, c.sd_psi_y_deg, c.sd_psi_z_deg})},
          {"r_m", brief({c.r_x_m, c.r_y_m, c.r_z_m})},
          {"sd_r_m", brief({c.sd_r_x_m, c.sd_r_y_m, c.sd_r_z_m})},
          {"t_d_ms", brief(c.t_d_ms)},
          {"sd_t_d_ms", brief(c.sd_t_d_ms)},
          {"observable", observable},
          {"goal_psi_deg", brief(c.goal_sd_psi_deg)},
          {"goal_r_m", brief(c.goal_sd_r_m)},
          {"goal_t_d_ms", brief(c.goal_sd_t_d_ms)},
          {"weakest", shown(c.weakest_direction)},
          {"weakest_relative", brief(c.weakest_relative_sd)},
          {"advice", shown(c.advice)},
          {"validity", c.validity}};
}

json to_json(const navigation_t& n) {
  return {{"time_s", known(n.time_s)},
          {"utime", n.utime},
          {"lat_deg", known(n.lat_deg)},
          {"lon_deg", known(n.lon_deg)},
          {"height_m", brief(n.height_m)},
          {"v_n_mps", brief(n.v_n_mps)},
          {"v_e_mps", brief(n.v_e_mps)},
          {"v_d_mps", brief(n.v_d_mps)},
          {"roll_deg", brief(n.roll_deg)},
          {"pitch_deg", brief(n.pitch_deg)},
          {"heading_deg", brief(n.heading_deg)},
          {"sd_n_m", brief(n.sd_n_m)},
          {"sd_e_m", brief(n.sd_e_m)},
          {"sd_heading_deg", brief(n.sd_heading_deg)},
          {"validity", n.validity},
          {"gnss_age_s", brief(n.gnss_age_s)}};
}

json to_json(const odometry_t& o) {
  return {{"speed_mps", brief(o.speed_mps)},         {"standing", o.standing != 0},
          {"zero_velocity", o.zero_velocity != 0},   {"lost", o.lost != 0},
          {"scale_percent", brief(o.scale_percent)}, {"sd_scale_percent", brief(o.sd_scale_percent)}};
}

json to_json(const wavelet_variance_t& variances) {
  return list_of(variances.axes, [](const axis_wavelet_variance_t& axis) -> json {
    return {{"axis", shown(axis.axis)},     {"regime", shown(axis.regime)},
            {"unit", shown(axis.unit)},     {"n", axis.n},
            {"tau_s", brief(axis.tau_s)},   {"value", brief(axis.value)},
            {"ci_low", brief(axis.ci_low)}, {"ci_high", brief(axis.ci_high)}};
  });
}

json to_json(const noise_model_t& models) {
  return list_of(models.models, [](const axis_noise_model_t& model) -> json {
    json parameters = json::array();
    for (const auto& p : model.parameters)
      parameters.push_back(json::array({shown(p.process), shown(p.name), shown(p.unit), brief(p.value)}));
    return {{"axis", shown(model.axis)},         {"regime", shown(model.regime)},
            {"model", shown(model.model)},       {"tau_s", brief(model.tau_s)},
            {"fitted", brief(model.fitted)},     {"parameters", std::move(parameters)},
            {"p_value", brief(model.j_p_value)}, {"identifiable", model.identifiable != 0}};
  });
}

}  // namespace imuscope::view
