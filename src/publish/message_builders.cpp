#include "publish/message_builders.h"

#include <algorithm>
#include <chrono>

#include "base/units.h"

namespace imuscope {
namespace {

constexpr double kUsPerS = 1e6;
constexpr double kBytesPerMb = 1e6;

std::int64_t as_count(std::uint64_t count) { return static_cast<std::int64_t>(count); }
constexpr double kPercent = 100.0;

// LCM counts arrays in int32.
template <typename Range>
std::int32_t size_of(const Range& range) {
  return static_cast<std::int32_t>(range.size());
}

device_status_t to_message(const StatusReport::Device& device) {
  device_status_t message;
  message.name = device.name;
  message.role = device.role;
  message.protocol = device.protocol;
  message.state = device.state;
  message.problem = device.problem;
  message.rate_hz = device.rate_hz;
  message.bytes = as_count(device.bytes);
  message.bytes_skipped = as_count(device.bytes_skipped);
  message.frames = as_count(device.frames);
  message.frames_dropped = as_count(device.frames_dropped);
  message.bad_checksums = as_count(device.bad_checksums);
  message.samples = as_count(device.samples);
  message.samples_lost = as_count(device.samples_lost);
  message.samples_late = as_count(device.samples_late);
  message.samples_refused = as_count(device.samples_refused);
  message.clock_resets = as_count(device.clock_resets);
  message.latency_ms = device.latency_s * kMsPerS;
  message.clock_drift_ppm = device.clock_drift_ppm;
  message.clock_sd_us = device.clock_sd_s * kUsPerS;
  return message;
}

study_status_t to_message(const StatusReport::Study& study) {
  study_status_t message;
  message.name = study.name;
  message.state = study.state;
  message.regime = study.regime;
  message.sd_psi_deg = study.sd_psi_rad * kDegPerRad;
  message.goal_psi_deg = study.goal_psi_rad * kDegPerRad;
  message.sd_r_m = study.sd_r_m;
  message.goal_r_m = study.goal_r_m;
  message.sd_t_d_ms = study.sd_t_d_s * kMsPerS;
  message.goal_t_d_ms = study.goal_t_d_s * kMsPerS;
  message.weakest = study.weakest;
  message.weakest_relative = study.weakest_relative;
  message.manoeuvre = study.manoeuvre;
  message.samples = as_count(study.samples);
  message.used = as_count(study.used);
  message.late = as_count(study.late);
  message.gated = as_count(study.gated);
  return message;
}

thread_status_t to_message(const StatusReport::Thread& thread) {
  thread_status_t message;
  message.name = thread.name;
  message.scheduling = thread.scheduling;
  message.cpu_percent = thread.cpu_share * kPercent;
  message.ticks = as_count(thread.ticks);
  message.overruns = as_count(thread.overruns);
  message.skipped = as_count(thread.skipped);
  message.lateness_p50_us = thread.lateness.p50_s * kUsPerS;
  message.lateness_p99_us = thread.lateness.p99_s * kUsPerS;
  message.lateness_p999_us = thread.lateness.p999_s * kUsPerS;
  message.lateness_max_us = thread.lateness.max_s * kUsPerS;
  message.done_p50_us = thread.done.p50_s * kUsPerS;
  message.done_p99_us = thread.done.p99_s * kUsPerS;
  message.done_p999_us = thread.done.p999_s * kUsPerS;
  message.done_max_us = thread.done.max_s * kUsPerS;
  message.n_octaves = size_of(thread.lateness_octaves);
  for (const std::uint64_t count : thread.lateness_octaves) {
    message.lateness_octaves.push_back(as_count(count));
  }
  return message;
}

ring_status_t to_message(const StatusReport::Ring& ring) {
  ring_status_t message;
  message.name = ring.name;
  message.capacity = as_count(ring.capacity);
  message.level = as_count(ring.level);
  message.high_water = as_count(ring.high_water);
  message.refused = as_count(ring.refused);
  return message;
}

axis_wavelet_variance_t to_message(const AxisWaveletVariance& axis) {
  axis_wavelet_variance_t message;
  message.axis = axis.axis;
  message.regime = axis.regime;
  message.unit = axis.unit;
  message.n = axis.n;
  message.rate_hz = axis.rate_hz;
  message.n_levels = size_of(axis.levels);
  for (const AxisWaveletVariance::Level& level : axis.levels) {
    message.level.push_back(level.level);
    message.tau_s.push_back(level.tau_s);
    message.value.push_back(level.value);
    message.ci_low.push_back(level.ci_low);
    message.ci_high.push_back(level.ci_high);
    message.n_coefficients.push_back(level.n_coefficients);
  }
  return message;
}

noise_parameter_t to_message(const AxisNoiseModel::Parameter& parameter) {
  noise_parameter_t message;
  message.process = parameter.process;
  message.name = parameter.name;
  message.unit = parameter.unit;
  message.value = parameter.value;
  message.sd = parameter.sd;
  message.ci_low = parameter.ci_low;
  message.ci_high = parameter.ci_high;
  return message;
}

axis_dynamics_t to_message(const AxisMotion& axis) {
  axis_dynamics_t message;
  message.axis = axis.axis;
  message.unit = axis.unit;
  message.mean = axis.mean;
  message.rms = axis.rms;
  message.largest = axis.largest;
  message.slope = axis.slope;
  message.slope_sd = axis.slope_sd;
  message.correlation = axis.correlation;
  message.r2 = axis.r2;
  message.f = axis.f;
  message.p_value = axis.p_value;
  return message;
}

covariate_motion_t to_message(const CovariateMotion& covariate) {
  covariate_motion_t message;
  message.name = covariate.name;
  message.unit = covariate.unit;
  message.mean = covariate.mean;
  message.rms = covariate.rms;
  message.largest = covariate.largest;
  return message;
}

axis_noise_model_t to_message(const AxisNoiseModel& model) {
  axis_noise_model_t message;
  message.axis = model.axis;
  message.regime = model.regime;
  message.unit = model.unit;
  message.n = model.n;
  message.rate_hz = model.rate_hz;
  message.model = model.model;
  message.weights = model.weights;
  message.n_parameters = size_of(model.parameters);
  for (const auto& parameter : model.parameters) message.parameters.push_back(to_message(parameter));
  message.n_levels = size_of(model.fitted);
  for (const auto& fitted : model.fitted) {
    message.tau_s.push_back(fitted.tau_s);
    message.fitted.push_back(fitted.value);
  }
  message.objective = model.objective;
  message.j_statistic = model.j_statistic;
  message.j_dof = model.j_dof;
  message.j_p_value = model.j_p_value;
  message.criterion = model.criterion;
  message.change_statistic = model.change_statistic;
  message.change_dof = model.change_dof;
  message.change_p_value = model.change_p_value;
  message.changed = model.changed;
  message.identifiable = model.identifiable ? 1 : 0;
  message.n_warnings = size_of(model.warnings);
  message.warnings = model.warnings;
  return message;
}

}  // namespace

std::int64_t to_utime(UtcTime utc) noexcept {
  return std::chrono::floor<std::chrono::microseconds>(utc).time_since_epoch().count();
}

status_t to_message(const StatusReport& report, std::int64_t sequence) {
  status_t message;
  message.utime = to_utime(report.utc);
  message.sequence = sequence;
  message.run = report.run;
  message.version = report.version;
  message.build = report.build;
  message.configuration_hash = report.configuration_hash;
  message.state = report.state;
  message.reason = report.reason;
  message.uptime_s = report.uptime_s;
  message.tick = report.tick;
  message.refits = as_count(report.refits);
  message.refit_duration_s = report.refit_duration_s;
  message.refit_utime = report.refit_utc ? to_utime(*report.refit_utc) : 0;
  message.resident_memory_mb = static_cast<double>(report.resident_memory_bytes) / kBytesPerMb;
  message.capture_path = report.capture_path;
  message.capture_bytes = as_count(report.capture_bytes);
  message.capture_lost = as_count(report.capture_lost);
  message.last_event = report.last_event;
  message.n_devices = size_of(report.devices);
  for (const auto& device : report.devices) message.devices.push_back(to_message(device));
  message.n_studies = size_of(report.studies);
  for (const auto& study : report.studies) message.studies.push_back(to_message(study));
  message.n_threads = size_of(report.threads);
  for (const auto& thread : report.threads) message.threads.push_back(to_message(thread));
  message.n_rings = size_of(report.rings);
  for (const auto& ring : report.rings) message.rings.push_back(to_message(ring));
  message.n_problems = size_of(report.problems);
  message.problems = report.problems;
  return message;
}

navigation_t to_message(const NavigationReport& report, std::int64_t sequence) {
  navigation_t message;
  message.utime = to_utime(report.utc);
  message.sequence = sequence;
  message.time_s = report.time_s;
  message.lat_deg = report.latitude_rad * kDegPerRad;
  message.lon_deg = report.longitude_rad * kDegPerRad;
  message.height_m = report.height_m;
  message.v_n_mps = report.v_n_mps[0];
  message.v_e_mps = report.v_n_mps[1];
  message.v_d_mps = report.v_n_mps[2];
  message.roll_deg = report.rpy_rad[0] * kDegPerRad;
  message.pitch_deg = report.rpy_rad[1] * kDegPerRad;
  message.heading_deg = report.rpy_rad[2] * kDegPerRad;
  message.sd_n_m = report.sd_position_m[0];
  message.sd_e_m = report.sd_position_m[1];
  message.sd_d_m = report.sd_position_m[2];
  message.sd_v_n_mps = report.sd_velocity_mps[0];
  message.sd_v_e_mps = report.sd_velocity_mps[1];
  message.sd_v_d_mps = report.sd_velocity_mps[2];
  message.sd_roll_deg = report.sd_rpy_rad[0] * kDegPerRad;
  message.sd_pitch_deg = report.sd_rpy_rad[1] * kDegPerRad;
  message.sd_heading_deg = report.sd_rpy_rad[2] * kDegPerRad;
  return message;
}

odometry_t to_message(const OdometryReport& report, std::int64_t sequence) {
  odometry_t message;
  message.utime = to_utime(report.utc);
  message.sequence = sequence;
  message.time_s = report.time_s;
  message.speed_mps = report.speed_mps;
  message.standing = static_cast<std::int8_t>(report.standing);
  message.zero_velocity = static_cast<std::int8_t>(report.zero_velocity);
  message.lost = static_cast<std::int8_t>(report.lost);
  message.scale_percent = report.scale * kPercent;
  message.sd_scale_percent = report.sd_scale * kPercent;
  message.mount_y_deg = report.mount_rad[1] * kDegPerRad;
  message.mount_z_deg = report.mount_rad[2] * kDegPerRad;
  message.sd_mount_y_deg = report.sd_mount_rad[1] * kDegPerRad;
  message.sd_mount_z_deg = report.sd_mount_rad[2] * kDegPerRad;
  message.axle_x_m = report.r_bv_b_m[0];
  message.axle_y_m = report.r_bv_b_m[1];
  message.axle_z_m = report.r_bv_b_m[2];
  message.sd_axle_x_m = report.sd_r_bv_b_m[0];
  message.sd_axle_y_m = report.sd_r_bv_b_m[1];
  message.sd_axle_z_m = report.sd_r_bv_b_m[2];
  message.nis_speed = report.nis[0];
  message.nis_sideways = report.nis[1];
  message.nis_upwards = report.nis[2];
  message.speed_used = as_count(report.speed_used);
  message.speed_rejected = as_count(report.speed_rejected);
  message.non_holonomic_used = as_count(report.non_holonomic_used);
  message.non_holonomic_rejected = as_count(report.non_holonomic_rejected);
  message.zero_velocity_used = as_count(report.zero_velocity_used);
  message.zero_velocity_rejected = as_count(report.zero_velocity_rejected);
  return message;
}

namespace {

/// Where the motion has shown nothing of a state, its number would say something that nobody knows.
void add_observability(const CalibrationReport& report, calibration_t& message) {
  const std::array<double*, 7> values{&message.psi_x_deg, &message.psi_y_deg, &message.psi_z_deg,
                                      &message.r_x_m,     &message.r_y_m,     &message.r_z_m,
                                      &message.t_d_ms};
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!report.observable[i]) *values[i] = kUnknown;
  }
  message.psi_x_observable = static_cast<std::int8_t>(report.observable[0]);
  message.psi_y_observable = static_cast<std::int8_t>(report.observable[1]);
  message.psi_z_observable = static_cast<std::int8_t>(report.observable[2]);
  message.r_x_observable = static_cast<std::int8_t>(report.observable[3]);
  message.r_y_observable = static_cast<std::int8_t>(report.observable[4]);
  message.r_z_observable = static_cast<std::int8_t>(report.observable[5]);
  message.t_d_observable = static_cast<std::int8_t>(report.observable[6]);
  message.goal_sd_psi_deg = report.goal_sd_psi_rad * kDegPerRad;
  message.goal_sd_r_m = report.goal_sd_r_m;
  message.goal_sd_t_d_ms = report.goal_sd_t_d_s * kMsPerS;
  message.weakest_direction = report.weakest_direction;
  message.weakest_relative_sd = report.weakest_relative_sd;
  message.advice = report.advice;
}

}  // namespace

calibration_t to_message(const CalibrationReport& report, const std::string& name, std::int64_t sequence) {
  calibration_t message;
  message.utime = to_utime(report.utc);
  message.sequence = sequence;
  message.name = name;
  message.time_s = report.time_s;
  message.q_w = report.q_b_s[0];
  message.q_x = report.q_b_s[1];
  message.q_y = report.q_b_s[2];
  message.q_z = report.q_b_s[3];

  const CalibrationStates& value = report.value;
  message.psi_x_deg = value.psi_b_rad[0] * kDegPerRad;
  message.psi_y_deg = value.psi_b_rad[1] * kDegPerRad;
  message.psi_z_deg = value.psi_b_rad[2] * kDegPerRad;
  message.r_x_m = value.r_bs_b_m[0];
  message.r_y_m = value.r_bs_b_m[1];
  message.r_z_m = value.r_bs_b_m[2];
  message.t_d_ms = value.t_d_s * kMsPerS;
  message.bg_x_radps = value.gyro_bias_s_radps[0];
  message.bg_y_radps = value.gyro_bias_s_radps[1];
  message.bg_z_radps = value.gyro_bias_s_radps[2];
  message.ba_x_mps2 = value.accel_bias_s_mps2[0];
  message.ba_y_mps2 = value.accel_bias_s_mps2[1];
  message.ba_z_mps2 = value.accel_bias_s_mps2[2];
  message.sg_x = value.gyro_scale[0];
  message.sg_y = value.gyro_scale[1];
  message.sg_z = value.gyro_scale[2];
  message.sa_x = value.accel_scale[0];
  message.sa_y = value.accel_scale[1];
  message.sa_z = value.accel_scale[2];

  const CalibrationStates& sd = report.sd;
  message.sd_psi_x_deg = sd.psi_b_rad[0] * kDegPerRad;
  message.sd_psi_y_deg = sd.psi_b_rad[1] * kDegPerRad;
  message.sd_psi_z_deg = sd.psi_b_rad[2] * kDegPerRad;
  message.sd_r_x_m = sd.r_bs_b_m[0];
  message.sd_r_y_m = sd.r_bs_b_m[1];
  message.sd_r_z_m = sd.r_bs_b_m[2];
  message.sd_t_d_ms = sd.t_d_s * kMsPerS;
  message.sd_bg_x_radps = sd.gyro_bias_s_radps[0];
  message.sd_bg_y_radps = sd.gyro_bias_s_radps[1];
  message.sd_bg_z_radps = sd.gyro_bias_s_radps[2];
  message.sd_ba_x_mps2 = sd.accel_bias_s_mps2[0];
  message.sd_ba_y_mps2 = sd.accel_bias_s_mps2[1];
  message.sd_ba_z_mps2 = sd.accel_bias_s_mps2[2];
  message.sd_sg_x = sd.gyro_scale[0];
  message.sd_sg_y = sd.gyro_scale[1];
  message.sd_sg_z = sd.gyro_scale[2];
  message.sd_sa_x = sd.accel_scale[0];
  message.sd_sa_y = sd.accel_scale[1];
  message.sd_sa_z = sd.accel_scale[2];
  add_observability(report, message);
  return message;
}

error_t to_message(const ErrorReport& report, const std::string& name, std::int64_t sequence) {
  error_t message;
  message.utime = to_utime(report.utc);
  message.sequence = sequence;
  message.name = name;
  message.time_s = report.time_s;
  message.counter = report.counter;
  message.e_gyro_x_radps = report.gyro_radps[0];
  message.e_gyro_y_radps = report.gyro_radps[1];
  message.e_gyro_z_radps = report.gyro_radps[2];
  message.e_accel_x_mps2 = report.accel_mps2[0];
  message.e_accel_y_mps2 = report.accel_mps2[1];
  message.e_accel_z_mps2 = report.accel_mps2[2];
  message.regime = regime_name(report.regime);
  return message;
}

wavelet_variance_t to_message(const WaveletVarianceReport& report, std::int64_t sequence) {
  wavelet_variance_t message;
  message.utime = to_utime(report.utc);
  message.sequence = sequence;
  message.name = report.name;
  message.time_s = report.time_s;
  message.n_axes = size_of(report.axes);
  for (const auto& axis : report.axes) message.axes.push_back(to_message(axis));
  return message;
}

noise_model_t to_message(const NoiseModelReport& report, std::int64_t sequence) {
  noise_model_t message;
  message.utime = to_utime(report.utc);
  message.sequence = sequence;
  message.name = report.name;
  message.time_s = report.time_s;
  message.n_models = size_of(report.models);
  for (const auto& model : report.models) message.models.push_back(to_message(model));
  return message;
}

dynamics_t to_message(const DynamicsReport& report, std::int64_t sequence) {
  dynamics_t message;
  message.utime = to_utime(report.utc);
  message.sequence = sequence;
  message.name = report.name;
  message.time_s = report.time_s;
  message.n_static = report.n_static;
  message.n_dynamic = report.n_dynamic;
  message.n_axes = size_of(report.axes);
  for (const auto& axis : report.axes) message.axes.push_back(to_message(axis));
  message.n_covariates = size_of(report.covariates);
  for (const auto& covariate : report.covariates) message.covariates.push_back(to_message(covariate));
  return message;
}

event_t to_message(const PersonEvent& event, std::int64_t sequence) {
  event_t message;
  message.utime = to_utime(event.utc);
  message.sequence = sequence;
  message.source = event.source;
  message.text = event.text;
  return message;
}

pose_t to_pose(const BridgeReport& report) {
  pose_t message;
  message.utime = to_utime(report.utc);
  std::copy(report.position_l_m.begin(), report.position_l_m.end(), message.pos);
  std::copy(report.velocity_b_mps.begin(), report.velocity_b_mps.end(), message.vel);
  std::copy(report.q_b_l.begin(), report.q_b_l.end(), message.orientation);
  std::copy(report.rate_lb_b_radps.begin(), report.rate_lb_b_radps.end(), message.rotation_rate);
  std::copy(report.acceleration_b_mps2.begin(), report.acceleration_b_mps2.end(), message.accel);
  return message;
}

ins_t to_ins(const BridgeReport& report) {
  ins_t message{};
  message.utime = to_utime(report.utc);
  message.device_time = report.counter;
  std::copy(report.measured_omega_b_radps.begin(), report.measured_omega_b_radps.end(), message.gyro);
  std::copy(report.measured_f_b_mps2.begin(), report.measured_f_b_mps2.end(), message.accel);
  std::copy(report.q_b_l.begin(), report.q_b_l.end(), message.quat);
  message.rel_alt = report.position_l_m[2];
  return message;
}

}  // namespace imuscope
