#pragma once

/// Reports in which every number differs from every other, so that a swapped field cannot hide.

#include "publish/reports.h"

namespace imuscope::test {

inline constexpr UtcTime kExampleUtc = utc_time_from_ns(1'700'000'000'123'456'789);

inline CalibrationStates example_states(double base) {
  CalibrationStates states{};
  double next = base;
  for (Vector3* vector : {&states.psi_b_rad, &states.r_bs_b_m, &states.gyro_bias_s_radps,
                          &states.accel_bias_s_mps2, &states.gyro_scale, &states.accel_scale}) {
    for (double& component : *vector) component = next += 1.0;
  }
  states.t_d_s = next + 1.0;
  return states;
}

inline CalibrationReport example_calibration() {
  CalibrationReport report{};
  report.utc = kExampleUtc;
  report.time_s = 12.5;
  report.device = 2;
  report.q_b_s = {0.5, -0.5, 0.1, 0.7};
  report.value = example_states(0.0);
  report.sd = example_states(100.0);
  report.observable.fill(true);
  report.goal_sd_psi_rad = 2e-4;
  report.goal_sd_r_m = 1e-3;
  report.goal_sd_t_d_s = 1e-4;
  report.weakest_direction = "boresight about down";
  report.weakest_relative_sd = 0.25;
  report.advice = "brake firmly";
  return report;
}

inline NavigationReport example_navigation() {
  return {kExampleUtc,
          3.25,
          0.8,
          0.15,
          432.1,
          {11, 12, 13},
          {0.1, -0.2, 3.0},
          {0.01, 0.02, 0.03},
          {0.04, 0.05, 0.06},
          {0.07, 0.08, 0.09}};
}

inline OdometryReport example_odometry() {
  return {kExampleUtc,
          4.75,
          12.25,
          true,
          true,
          false,
          0.012,
          0.003,
          {0.0, 0.01, 0.02},
          {0.0, 0.03, 0.04},
          {1, 2, 3},
          {4, 5, 6},
          {0.7, 0.8, 0.9},
          21,
          22,
          23,
          24,
          25,
          26};
}

inline ErrorReport example_error() {
  return {kExampleUtc, 7.75, 1, Regime::kDynamic, 70'001, {1e-3, 2e-3, 3e-3}, {0.1, 0.2, 0.3}};
}

inline WaveletVarianceReport example_wavelet_variance() {
  AxisWaveletVariance axis{"gyro_x", "static", "rad/s", 6000, 100.0, {}};
  axis.levels.push_back({1, 0.02, 1e-6, 0.9e-6, 1.2e-6, 5999});
  axis.levels.push_back({2, 0.04, 5e-7, 4e-7, 7e-7, 5997});
  return {kExampleUtc, 60.0, "mtx1", {axis, axis}};
}

inline NoiseModelReport example_noise_model() {
  AxisNoiseModel model;
  model.axis = "accel_z";
  model.regime = "dynamic";
  model.unit = "m/s^2";
  model.n = 6000;
  model.rate_hz = 100.0;
  model.model = "WN+GM";
  model.weights = "optimal";
  model.parameters.push_back({"WN", "sigma2", "(m/s^2)^2", 1.0, 0.1, 0.8, 1.2});
  model.parameters.push_back({"GM1", "beta", "1/s", 0.5, kUnknown, kUnknown, kUnknown});
  model.fitted.push_back({0.02, 0.25});
  model.objective = 3.5;
  model.j_statistic = 4.5;
  model.j_dof = 7;
  model.j_p_value = 0.72;
  model.criterion = -2.5;
  model.change_statistic = 61.5;
  model.change_dof = 9.0;
  model.change_p_value = 7e-10;
  model.changed = true;
  model.identifiable = true;
  model.warnings = {"the slowest process is longer than the data"};
  return {kExampleUtc, 61.0, "mtx1", {model}};
}

inline StatusReport example_status() {
  StatusReport report;
  report.utc = kExampleUtc;
  report.run = "demo";
  report.version = "0.1.0";
  report.state = "degraded";
  report.reason = "mtx2 is silent";
  report.uptime_s = 61.5;
  report.tick = 6150;
  report.refits = 3;
  report.refit_duration_s = 0.8;
  report.resident_memory_bytes = 41'000'000;
  report.capture_path = "run/capture.lcm";
  report.capture_bytes = 123;
  report.capture_lost = 4;
  report.build = "g++ 12";
  report.configuration_hash = "abc";
  report.refit_utc = kExampleUtc;
  report.last_event = "roundabout";
  StatusReport::Study study;
  study.name = "mtx1";
  study.state = "converging";
  study.regime = "dynamic";
  study.sd_psi_rad = 0.01;
  study.goal_psi_rad = 0.001;
  study.sd_r_m = 0.02;
  study.goal_r_m = 0.002;
  study.sd_t_d_s = 0.003;
  study.goal_t_d_s = 0.0003;
  study.weakest = "psi_z";
  study.weakest_relative = 0.5;
  study.manoeuvre = "brake";
  study.samples = 21;
  study.used = 22;
  study.late = 23;
  study.gated = 24;
  report.studies = {study};
  StatusReport::Device device;
  device.name = "mtx1";
  device.role = "study";
  device.protocol = "xsens_mt";
  device.state = "streaming";
  device.problem = "none";
  device.rate_hz = 99.9;
  device.bytes = 1;
  device.bytes_skipped = 2;
  device.frames = 3;
  device.frames_dropped = 10;
  device.bad_checksums = 4;
  device.samples = 5;
  device.samples_lost = 6;
  device.samples_late = 7;
  device.samples_refused = 8;
  device.clock_resets = 9;
  device.latency_s = 0.0042;
  device.clock_drift_ppm = -11.5;
  device.clock_sd_s = 25e-6;
  report.devices = {device, device};
  StatusReport::Thread thread;
  thread.name = "estimator";
  thread.scheduling = "fifo 80";
  thread.ticks = 10;
  thread.overruns = 11;
  thread.skipped = 12;
  thread.cpu_share = 0.004;
  thread.lateness = {13e-6, 14e-6, 15e-6, 16e-6};
  thread.done = {17e-6, 18e-6, 19e-6, 20e-6};
  thread.lateness_octaves = {1, 0, 9};
  report.threads = {thread};
  report.rings = {{"samples", 1024, 17, 18, 19}};
  report.problems = {"no route; run ip route add"};
  return report;
}

}  // namespace imuscope::test
