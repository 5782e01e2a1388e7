#pragma once

/// Everything that an estimator shows, as lines of a recorded answer.

#include <algorithm>
#include <cmath>
#include <string>
#include <variant>
#include <vector>

#include "estimation/calibration/estimator.h"
#include "tests/support/answer.h"

namespace imuscope::test {

inline double seconds_of(HostTime time) { return to_seconds(time - HostTime{}); }
/// Since the beginning of 2025; a float of nine digits holds no more.
inline double seconds_of(UtcTime utc) {
  return static_cast<double>(to_ns(utc) - 1'735'689'600'000'000'000) * 1e-9;
}

inline void add_navigation(Answer& lines, const NavigationOutput& n) {
  lines.line("navigation", n.status, n.method, seconds_of(n.time), n.has_utc,
             n.has_utc ? seconds_of(n.utc) : 0.0, n.has_gnss, seconds_of(n.gnss_time), n.gnss_contradicts);
  if (n.status != NavigationStatus::kNavigating) return;
  // Metres about a grid of some kilometres: of the angles, nine digits are no metre.
  constexpr double kGrid_rad = 1e-3;
  constexpr double kEarth_m = 6.4e6;
  lines.line(" position", kEarth_m * std::remainder(n.latitude_rad, kGrid_rad),
             kEarth_m * std::remainder(n.longitude_rad, kGrid_rad), n.height_m, n.sd_position_m);
  lines.line(" velocity", n.v_n_mps, n.sd_velocity_mps);
  lines.line(" attitude", n.rpy_rad, n.sd_rpy_rad, n.C_b_n);
  lines.line(" gyro bias e6", 1e6 * n.gyro_bias_radps[0], 1e6 * n.gyro_bias_radps[1],
             1e6 * n.gyro_bias_radps[2], 1e6 * n.sd_gyro_bias_radps[0], 1e6 * n.sd_gyro_bias_radps[1],
             1e6 * n.sd_gyro_bias_radps[2]);
  lines.line(" accel bias", n.accel_bias_mps2, n.sd_accel_bias_mps2);
  lines.line(" nis", n.nis_position, n.nis_velocity);
  lines.line(" antenna", n.antenna_lever_arm_b_m, n.sd_antenna_lever_arm_m, n.receiver_latency_s,
             n.sd_receiver_latency_s);
}

inline void add_study(Answer& lines, const SImuOutput& s) {
  lines.line("study", s.status, s.regime, seconds_of(s.time), s.contradicts, s.t_d_observable, s.observable);
  lines.line(" goal", s.goal.boresight_sd_rad, s.goal.lever_arm_sd_m, s.goal.time_offset_sd_s);
  lines.line(" mounting", s.C_b_s, s.C_prior);
  lines.line(" psi", s.psi_rad, s.sd_psi_rad);
  lines.line(" r", s.r_bs_b_m, s.sd_r_bs_b_m);
  lines.line(" t_d", s.t_d_s, s.sd_t_d_s);
  lines.line(" gyro bias", s.gyro_bias_radps, s.sd_gyro_bias_radps);
  lines.line(" accel bias", s.accel_bias_mps2, s.sd_accel_bias_mps2);
  lines.line(" gyro scale", s.gyro_scale, s.sd_gyro_scale);
  lines.line(" accel scale", s.accel_scale, s.sd_accel_scale);
  lines.line(" accel triad", s.accel_boresight_rad, s.sd_accel_boresight_rad, s.accel_t_d_s,
             s.sd_accel_t_d_s);
  std::vector<double> covariance;
  for (std::size_t i = 0; i < 36; ++i)
    if (i % 6 >= i / 6) covariance.push_back(1e6 * s.covariance_psi_r[i]);
  lines.line(" covariance e6", covariance);
  lines.line(" nis", s.nis_gyro, s.nis_accel);
  // An eigenvector's sign is nobody's.
  std::array<double, 6> weakest = s.weakest_direction;
  if (*std::ranges::max_element(weakest, {}, [](double v) { return std::abs(v); }) < 0.0)
    for (double& v : weakest) v = -v;
  lines.line(" weakest", weakest, s.weakest_component, s.weakest_relative_sd);
  const SImuCounters& c = s.counters;
  lines.line(" counters", c.samples, c.used, c.late, c.no_reference, c.waiting, c.refused_full,
             c.not_increasing, c.not_finite, c.coarse_attempts, c.resets, c.gated_gyro, c.gated_accel,
             c.clipped_gyro, c.clipped_accel);
}

inline void add_odometry(Answer& lines, const OdometryOutput& o) {
  lines.line("odometry", o.enabled, o.standing, o.resting, o.lost, o.has_speed, seconds_of(o.time),
             o.speed_mps);
  lines.line(" scale", o.scale, o.sd_scale);
  lines.line(" mount", o.mount_rad, o.sd_mount_rad);
  lines.line(" arm", o.r_bv_b_m, o.sd_r_bv_b_m);
  lines.line(" nis", o.nis);
}

inline void add_counters(Answer& lines, const EstimatorCounters& c) {
  lines.line("counters", c.ticks, c.reference_samples, c.reference_gaps, c.reference_not_increasing,
             c.reference_not_finite, c.unknown_device, c.covariance_repairs, c.events_lost, c.epochs_lost);
  lines.line(" gnss", c.gnss_samples, c.gnss_used, c.gnss_rejected, c.gnss_positions_rejected, c.gnss_too_old,
             c.gnss_not_finite);
  lines.line(" odometry", c.odometry_samples, c.odometry_speed_used, c.odometry_speed_rejected,
             c.odometry_slip_used, c.odometry_slip_rejected, c.zero_velocity_used, c.zero_velocity_rejected,
             c.odometry_too_old, c.odometry_not_finite);
}

inline void add_estimator(Answer& lines, const Estimator& estimator) {
  add_navigation(lines, estimator.navigation());
  if (estimator.odometry().enabled) add_odometry(lines, estimator.odometry());
  for (std::size_t i = 0; i < estimator.study_count(); ++i) add_study(lines, estimator.study(i));
  add_counters(lines, estimator.counters());
  const TimeScale& scale = estimator.time_scale();
  lines.line("time scale", scale.source, 1e6 * scale.rate);
}

/// The numbers that an event bears, whatever it is.
template <typename Event>
void add_event_numbers(Answer& lines, const Event& e) {
  const auto number = [&](double value) { lines.line("  bears", value); };
  if constexpr (requires { e.method; }) number(static_cast<double>(e.method));
  if constexpr (requires { e.gap_s; }) number(e.gap_s);
  if constexpr (requires { e.length_s; }) number(e.length_s);
  if constexpr (requires { e.f_z_b_mps2; }) number(e.f_z_b_mps2);
  if constexpr (requires { e.f_mps2; }) number(e.f_mps2);
  if constexpr (requires { e.residual_rad; }) number(e.residual_rad);
  if constexpr (requires { e.rate_correlation; }) number(e.rate_correlation);
  if constexpr (requires { e.mean_nis; }) number(e.mean_nis);
  if constexpr (requires { e.nis; }) number(e.nis);
  if constexpr (requires { e.streak_s; }) number(e.streak_s);
  if constexpr (requires { e.share; }) number(e.share);
  if constexpr (requires { e.silence_s; }) number(e.silence_s);
  if constexpr (requires { e.excess_mps; }) number(e.excess_mps);
  if constexpr (requires { e.state; }) number(static_cast<double>(e.state));
  if constexpr (requires { e.angle_rad; }) number(e.angle_rad);
  if constexpr (requires { e.distance_m; }) number(e.distance_m);
  if constexpr (requires { e.other; }) number(e.other);
  if constexpr (requires { e.change_radps; }) number(e.change_radps);
  if constexpr (requires { e.change_mps2; }) number(e.change_mps2);
  if constexpr (requires { e.factor; }) lines.line("  bears", e.gyro, e.factor, e.white_sd);
}

inline void add_event(Answer& lines, const EstimatorEvent& event) {
  lines.line(" event", event.what.index(), event.device, seconds_of(event.time));
  std::visit([&](const auto& what) { add_event_numbers(lines, what); }, event.what);
}

inline void add_epoch(Answer& lines, const SImuEpoch& e) {
  lines.line("epoch", e.study, seconds_of(e.time), e.t_d_s, e.regime, e.calibrating, e.used_gyro,
             e.used_accel, e.utc.is_known, e.utc.is_known ? seconds_of(e.utc.utc) : 0.0,
             e.utc.gps_minus_utc_s);
  lines.line(" reference", e.omega_ib_b_radps, e.omega_dot_ib_b_radps2, e.omega_ddot_ib_b_radps3, e.f_b_mps2,
             e.f_dot_b_mps3);
  lines.line(" biases", e.reference_gyro_bias_radps, e.reference_accel_bias_mps2);
  lines.line(" mounting", e.C_b_s, e.r_bs_b_m);
  lines.line(" innovation", e.innovation_gyro_radps, e.innovation_accel_mps2, e.variance_gyro,
             e.variance_accel);
}

}  // namespace imuscope::test
