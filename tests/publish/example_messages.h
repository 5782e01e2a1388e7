#pragma once

/// Messages for those who carry or show them, whole and with numbers that differ.

#include <imuscope/calibration_t.hpp>
#include <imuscope/dynamics_t.hpp>
#include <imuscope/error_t.hpp>
#include <imuscope/event_t.hpp>
#include <imuscope/ins_t.hpp>
#include <imuscope/navigation_t.hpp>
#include <imuscope/noise_model_t.hpp>
#include <imuscope/odometry_t.hpp>
#include <imuscope/pc_clock_t.hpp>
#include <imuscope/pose_t.hpp>
#include <imuscope/status_t.hpp>
#include <imuscope/virtual_imu_t.hpp>
#include <imuscope/wavelet_variance_t.hpp>
#include <string>

#include "publish/message_values.h"

namespace imuscope::test {

inline constexpr std::int64_t kExampleUtime = 1'700'000'000'123'456;

inline calibration_t example_calibration() {
  calibration_t m{};
  m.utime = kExampleUtime;
  m.name = "mtx1";
  m.time_s = 12.5;
  m.q_w = 0.5;
  m.psi_x_deg = 1.0;
  m.sd_psi_x_deg = 0.1;
  m.r_x_m = 4.0;
  m.weakest_direction = "boresight about down";
  m.weakest_relative_sd = 0.25;
  m.advice = "brake firmly";
  return m;
}

inline navigation_t example_navigation() {
  navigation_t m{};
  m.utime = kExampleUtime;
  m.time_s = 3.25;
  m.lat_deg = 46.5;
  m.lon_deg = 8.6;
  m.height_m = 432.1;
  m.gps_week = 2290;
  m.gps_tow_s = 166'418.25;
  m.validity = navigation_t::COASTING;
  m.reference_age_s = 0.012;
  m.gnss_age_s = 7.5;
  return m;
}

inline odometry_t example_odometry() {
  odometry_t m{};
  m.utime = kExampleUtime;
  m.time_s = 4.75;
  m.speed_mps = 12.25;
  m.standing = 1;
  m.zero_velocity = 1;
  m.scale_percent = 1.2;
  m.sd_scale_percent = 0.3;
  m.speed_used = 21;
  m.speed_rejected = 22;
  m.non_holonomic_used = 23;
  m.non_holonomic_rejected = 24;
  m.zero_velocity_used = 25;
  m.zero_velocity_rejected = 26;
  return m;
}

inline pc_clock_t example_pc_clock() {
  pc_clock_t m{};
  m.utime = kExampleUtime;
  m.host_ns = 123'456'789;
  m.wall_ns = kExampleUtime * 1000;
  m.step_s = -1.0;
  m.is_known = 1;
  m.is_synchronised = 1;
  m.frequency_ppm = -12.5;
  m.max_error_s = 0.02;
  return m;
}

inline error_t example_error(const std::string& name = "mtx1") {
  error_t m{};
  m.utime = kExampleUtime;
  m.name = name;
  m.regime = "dynamic";
  error_row_t row{};
  row.utime = kExampleUtime;
  row.time_s = 7.75;
  row.counter = 70'001;
  row.e_gyro_x_radps = 1e-3;
  m.rows = {row};
  m.n_rows = element_count(m.rows);
  return m;
}

inline virtual_imu_t example_virtual_imu() {
  virtual_imu_t m{};
  m.utime = kExampleUtime;
  m.imus = {"mtx1", "mtx2"};
  m.n_imus = element_count(m.imus);
  m.place_of_x_m[1] = 0.25;
  virtual_imu_row_t row{};
  row.utime = kExampleUtime;
  row.time_s = 7.75;
  row.omega_z_radps = 0.125;
  row.e_gyro_z_radps = 1e-3;
  m.rows = {row};
  m.n_rows = element_count(m.rows);
  return m;
}

inline wavelet_variance_t example_wavelet_variance() {
  axis_wavelet_variance_t axis{};
  axis.axis = "gyro_x";
  axis.regime = "static";
  axis.unit = "rad/s";
  axis.n = 6000;
  axis.rate_hz = 100.0;
  axis.n_levels = 2;
  axis.level = {1, 2};
  axis.tau_s = {0.02, 0.04};
  axis.value = {1e-6, 5e-7};
  axis.ci_low = {0.9e-6, 4e-7};
  axis.ci_high = {1.2e-6, 7e-7};
  axis.n_coefficients = {5999, 5997};
  wavelet_variance_t m{};
  m.utime = kExampleUtime;
  m.name = "mtx1";
  m.time_s = 60.0;
  m.axes = {axis, axis};
  m.n_axes = element_count(m.axes);
  return m;
}

inline noise_model_t example_noise_model() {
  noise_parameter_t white{};
  white.process = "WN";
  white.name = "sigma2";
  white.unit = "(m/s^2)^2";
  white.value = 1.0;
  axis_noise_model_t model{};
  model.axis = "accel_z";
  model.regime = "dynamic";
  model.unit = "m/s^2";
  model.n = 6000;
  model.rate_hz = 100.0;
  model.model = "WN";
  model.weights = "optimal";
  model.intervals = "quick";
  model.parameters = {white};
  model.n_parameters = element_count(model.parameters);
  model.j_p_value = 0.72;
  model.identifiable = 1;
  noise_model_t m{};
  m.utime = kExampleUtime;
  m.name = "mtx1";
  m.time_s = 61.0;
  m.models = {model};
  m.n_models = element_count(m.models);
  return m;
}

inline dynamics_t example_dynamics() {
  dynamics_t m{};
  m.utime = kExampleUtime;
  m.name = "mtx1";
  m.time_s = 61.0;
  m.n_static = 1;
  m.n_dynamic = 2;
  return m;
}

inline event_t example_event(const std::string& text = "here") {
  event_t m{};
  m.utime = kExampleUtime;
  m.source = "example";
  m.text = text;
  return m;
}

inline study_status_t example_study_status() {
  study_status_t m{};
  m.name = "mtx1";
  m.state = "converging";
  m.regime = "dynamic";
  m.sd_psi_deg = 0.573;
  m.goal_psi_deg = 0.0573;
  m.sd_r_m = 0.02;
  m.goal_r_m = 0.002;
  m.sd_t_d_ms = 3.0;
  m.goal_t_d_ms = 0.3;
  m.weakest = "psi_z";
  m.weakest_relative = 0.5;
  m.manoeuvre = "brake";
  m.samples = 21;
  m.used = 22;
  m.late = 23;
  m.gated = 24;
  return m;
}

inline device_status_t example_device_status() {
  device_status_t m{};
  m.name = "mtx1";
  m.role = "study";
  m.protocol = "xsens_mt";
  m.state = "streaming";
  m.problem = "none";
  m.rate_hz = 99.9;
  m.bytes = 1;
  m.bytes_skipped = 2;
  m.frames = 3;
  m.frames_dropped = 10;
  m.bad_checksums = 4;
  m.samples = 5;
  m.samples_lost = 6;
  m.samples_late = 7;
  m.samples_refused = 8;
  m.clock_resets = 9;
  m.latency_ms = 4.2;
  m.clock_drift_ppm = -11.5;
  m.clock_sd_us = 25.0;
  m.wire_ms = 3.7;
  m.adapter_ms = 1.0;
  m.t_d_ms = -4.8;
  m.sd_t_d_ms = 0.02;
  return m;
}

inline status_t example_status() {
  thread_status_t thread{};
  thread.name = "estimator";
  thread.scheduling = "fifo 80";
  thread.ticks = 10;
  thread.overruns = 11;
  thread.skipped = 12;
  thread.cpu_percent = 0.4;
  thread.heartbeat_age_s = 0.02;
  thread.lateness_p50_us = 13.0;
  thread.lateness_p99_us = 14.0;
  thread.lateness_p999_us = 15.0;
  thread.lateness_max_us = 16.0;
  thread.done_p50_us = 17.0;
  thread.done_p99_us = 18.0;
  thread.done_p999_us = 19.0;
  thread.done_max_us = 20.0;
  thread.lateness_octaves = {1, 0, 9};
  thread.n_octaves = element_count(thread.lateness_octaves);
  ring_status_t ring{};
  ring.name = "samples";
  ring.capacity = 1024;
  ring.level = 17;
  ring.high_water = 18;
  ring.refused = 19;
  status_t m{};
  m.utime = kExampleUtime;
  m.run = "demo";
  m.version = "0.1.0";
  m.build = "g++ 12";
  m.configuration_hash = "abc";
  m.state = "degraded";
  m.reason = "mtx2 is silent";
  m.uptime_s = 61.5;
  m.tick = 6150;
  m.refits = 3;
  m.refit_duration_s = 0.8;
  m.refit_utime = kExampleUtime;
  m.resident_memory_mb = 41.0;
  m.capture_path = "run/capture.lcm";
  m.capture_bytes = 123;
  m.capture_lost = 4;
  m.utc_source = "reference";
  m.utc_sd_s = 3e-5;
  m.host_clock_ppm = 17.0;
  m.last_event = "roundabout";
  m.devices = {example_device_status(), example_device_status()};
  m.n_devices = element_count(m.devices);
  m.studies = {example_study_status()};
  m.n_studies = element_count(m.studies);
  m.threads = {thread};
  m.n_threads = element_count(m.threads);
  m.rings = {ring};
  m.n_rings = element_count(m.rings);
  alarm_t alarm{};
  alarm.kind = "bus";
  alarm.subject = "LCM";
  alarm.what = "no route";
  alarm.remedy = "run ip route add";
  alarm.active = 1;
  alarm.since_utime = kExampleUtime;
  alarm.lasted_s = 21.0;
  alarm.times = 22;
  m.alarms = {alarm};
  m.n_alarms = element_count(m.alarms);
  return m;
}

}  // namespace imuscope::test
