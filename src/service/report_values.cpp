#include "service/report_values.h"

#include <Eigen/Geometry>

#include "navigation/gravity.h"
#include "navigation/wgs84.h"
#include "noise/json.h"
#include "service/noise_series.h"
#include "service/observability.h"

namespace imuscope {

namespace {

std::array<double, 4> quaternion(const Matrix3& C_b_s) {
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> C(C_b_s.data());
  Eigen::Quaterniond q(Eigen::Matrix3d{C});
  if (q.w() < 0.0) q.coeffs() = -q.coeffs();
  return {q.w(), q.x(), q.y(), q.z()};
}

}  // namespace

NavigationReport navigation_report(const Snapshot& snapshot, const UtcAnchor& anchor) {
  const auto& nav = snapshot.navigation;
  NavigationReport report{};
  report.utc = nav.has_utc ? nav.utc : anchor.at(nav.time);
  report.time_s = to_seconds(nav.time - snapshot.first_reference_time);
  report.latitude_rad = nav.latitude_rad;
  report.longitude_rad = nav.longitude_rad;
  report.height_m = nav.height_m;
  report.v_n_mps = nav.v_n_mps;
  report.rpy_rad = nav.rpy_rad;
  report.sd_position_m = nav.sd_position_m;
  report.sd_velocity_mps = nav.sd_velocity_mps;
  report.sd_rpy_rad = nav.sd_rpy_rad;
  return report;
}

OdometryReport odometry_report(const Snapshot& snapshot, const UtcAnchor& anchor) {
  const OdometryOutput& out = snapshot.odometry;
  const EstimatorCounters& counters = snapshot.counters;
  OdometryReport report{};
  report.utc = anchor.at(out.time);
  report.time_s = to_seconds(out.time - snapshot.first_reference_time);
  report.speed_mps = out.speed_mps;
  report.standing = out.standing;
  report.zero_velocity = out.resting;
  report.lost = out.lost;
  report.scale = out.scale;
  report.sd_scale = out.sd_scale;
  report.mount_rad = out.mount_rad;
  report.sd_mount_rad = out.sd_mount_rad;
  report.r_bv_b_m = out.r_bv_b_m;
  report.sd_r_bv_b_m = out.sd_r_bv_b_m;
  report.nis = out.nis;
  report.speed_used = counters.odometry_speed_used;
  report.speed_rejected = counters.odometry_speed_rejected;
  report.non_holonomic_used = counters.odometry_slip_used;
  report.non_holonomic_rejected = counters.odometry_slip_rejected;
  report.zero_velocity_used = counters.zero_velocity_used;
  report.zero_velocity_rejected = counters.zero_velocity_rejected;
  return report;
}

BridgeReport bridge_report(const Snapshot& snapshot, const Snapshot& origin, const UtcAnchor& anchor) {
  const auto& nav = snapshot.navigation;
  const auto& first = origin.navigation;
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> C_b_n(nav.C_b_n.data());
  // The widespread types look forward-left-up (F) and east-north-up (U).
  const Eigen::Matrix3d C_b_F = Eigen::Vector3d(1.0, -1.0, -1.0).asDiagonal();
  Eigen::Matrix3d C_n_U;
  C_n_U << 0, 1, 0, 1, 0, 0, 0, 0, -1;
  const Eigen::Matrix3d C_n_b = C_b_n.transpose();

  const Eigen::Vector3d position_n = ned_offset({first.latitude_rad, first.longitude_rad, first.height_m},
                                                {nav.latitude_rad, nav.longitude_rad, nav.height_m});
  const auto vector = [](const Vector3& v) { return Eigen::Vector3d(v[0], v[1], v[2]); };
  const Eigen::Vector3d omega_ib_b = vector(snapshot.reference.omega_radps) - vector(nav.gyro_bias_radps);
  const Eigen::Vector3d f_b = vector(snapshot.reference.f_mps2) - vector(nav.accel_bias_mps2);
  const Eigen::Vector3d omega_ie_n = earth_rate_n(nav.latitude_rad);
  const Eigen::Vector3d g_n(0.0, 0.0, normal_gravity(nav.latitude_rad, nav.height_m).g_mps2);

  const auto array = [](const Eigen::Vector3d& v) { return Vector3{v[0], v[1], v[2]}; };
  const Eigen::Quaterniond q(Eigen::Matrix3d(C_n_U * C_b_n * C_b_F.transpose()));
  BridgeReport report;
  report.utc = nav.has_utc ? nav.utc : anchor.at(nav.time);
  report.position_l_m = array(C_n_U * position_n);
  report.velocity_b_mps = array(C_b_F * C_n_b * vector(nav.v_n_mps));
  report.q_b_l = {q.w(), q.x(), q.y(), q.z()};
  report.rate_lb_b_radps = array(C_b_F * (omega_ib_b - C_n_b * omega_ie_n));
  report.acceleration_b_mps2 = array(C_b_F * (f_b + C_n_b * g_n));
  report.counter = snapshot.reference.counter;
  report.measured_omega_b_radps = array(C_b_F * vector(snapshot.reference.omega_radps));
  report.measured_f_b_mps2 = array(C_b_F * vector(snapshot.reference.f_mps2));
  return report;
}

CalibrationReport calibration_report(const Snapshot& snapshot, std::size_t study, DeviceIndex device,
                                     const UtcAnchor& anchor) {
  const auto& estimate = snapshot.studies[study];
  CalibrationReport report{};
  report.utc = anchor.at(estimate.time);
  report.time_s = to_seconds(estimate.time - snapshot.first_reference_time);
  report.device = device;
  report.q_b_s = quaternion(estimate.C_b_s);
  report.value = {estimate.psi_rad,         estimate.r_bs_b_m,        estimate.t_d_s,
                  estimate.gyro_bias_radps, estimate.accel_bias_mps2, estimate.gyro_scale,
                  estimate.accel_scale};
  report.sd = {estimate.sd_psi_rad,         estimate.sd_r_bs_b_m,        estimate.sd_t_d_s,
               estimate.sd_gyro_bias_radps, estimate.sd_accel_bias_mps2, estimate.sd_gyro_scale,
               estimate.sd_accel_scale};
  const Observability observability = observability_of(estimate);
  for (std::size_t i = 0; i < report.observable.size(); ++i)
    report.observable[i] = observability.states[i].observable;
  const StudyConfig goals;
  report.goal_sd_psi_rad = goals.goal_boresight_sd_rad;
  report.goal_sd_r_m = goals.goal_r_bs_b_sd_m;
  report.goal_sd_t_d_s = goals.goal_t_d_sd_s;
  report.weakest_direction = observability.weakest;
  report.weakest_relative_sd = observability.weakest_relative_sd;
  report.advice = observability.advice;
  return report;
}

ErrorReport error_report(const ErrorRecord& record, DeviceIndex device, const UtcAnchor& anchor) {
  constexpr Vector3 kUnknownVector{kUnknown, kUnknown, kUnknown};
  const auto& row = record.row;
  ErrorReport report{};
  report.utc = anchor.at(row.time);
  report.time_s = to_seconds(row.time - record.first_reference_time);
  report.device = device;
  report.regime = row.regime;
  report.counter = row.counter;
  report.gyro_radps = row.gyro_valid ? row.e_gyro_radps : kUnknownVector;
  report.accel_mps2 = row.accel_valid ? row.e_accel_mps2 : kUnknownVector;
  return report;
}

AxisWaveletVariance axis_wavelet_variance(const noise::WaveletVariance& wv, std::size_t axis, Regime regime,
                                          double rate_hz) {
  AxisWaveletVariance out;
  out.axis = axis_name(axis);
  out.regime = regime_name(regime);
  out.unit = axis_unit(axis);
  out.n = static_cast<std::int64_t>(wv.n_valid);
  out.rate_hz = rate_hz;
  for (const auto& level : wv.levels) {
    out.levels.push_back({level.level, level.tau_samples / rate_hz, level.value, level.ci_low, level.ci_high,
                          static_cast<std::int64_t>(level.n_coefficients)});
  }
  return out;
}

nlohmann::json model_json(const noise::FitResult& fit, const std::string& name, std::size_t axis,
                          const std::string& regime) {
  nlohmann::json model = noise::fit_to_json(fit);
  model["name"] = name;
  model["axis"] = axis_name(axis);
  model["regime"] = regime;
  model["unit"] = axis_unit(axis);
  return model;
}

AxisNoiseModel axis_noise_model(const noise::FitResult& fit, std::size_t axis, Regime regime) {
  AxisNoiseModel out;
  out.axis = axis_name(axis);
  out.regime = regime_name(regime);
  out.unit = axis_unit(axis);
  out.n = static_cast<std::int64_t>(fit.n);
  out.rate_hz = fit.rate_hz;
  out.model = fit.spec.name();
  out.weights = fit.weighting == noise::Weighting::kOptimal ? "optimal" : "ci";
  for (const auto& parameter : fit.parameters) {
    out.parameters.push_back({parameter.process, parameter.name, parameter.unit, parameter.value,
                              parameter.sd.value_or(kUnknown), parameter.ci_low.value_or(kUnknown),
                              parameter.ci_high.value_or(kUnknown)});
  }
  for (const auto& level : fit.wv) {
    out.fitted.push_back({level.observed.tau_samples / fit.rate_hz, level.fitted});
  }
  out.objective = fit.objective;
  if (fit.j_test) {
    out.j_statistic = fit.j_test->statistic;
    out.j_dof = fit.j_test->dof;
    out.j_p_value = fit.j_test->p_value;
  }
  out.criterion = fit.criterion;
  out.identifiable = fit.identifiable;
  out.warnings = fit.warnings;
  return out;
}

}  // namespace imuscope
