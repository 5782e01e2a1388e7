#pragma once

/// A run in which nothing is zero and no two numbers are the same, for answers that are held whole.

#include <array>

#include "configuration/config.h"
#include "service/pipeline/core.h"
#include "service/pipeline/refit.h"
#include "service/run/pc_clock.h"

namespace imuscope::test {

inline Configuration rich_configuration() {
  return *parse_configuration(R"(
[run]
name = "rich"
[[device]]
name = "airins"
role = "reference"
protocol = "csv_imu"
[[device]]
name = "left"
role = "study"
protocol = "csv_imu"
[device.data_sheet]
gyro_density_degps_per_sqrt_hz = 0.007
gyro_bias_stability_deg_per_h = 8.0
accel_density_ug_per_sqrt_hz = 70.0
accel_bias_stability_ug = 15.0
[[device]]
name = "right"
role = "study"
protocol = "csv_imu"
[[device]]
name = "antenna"
role = "gnss"
protocol = "nmea"
[virtual_imu]
imus = ["left", "right"]
)",
                              "rich.toml");
}

/// 0.001, 0.002 and so on.
class Numbers {
 public:
  double operator()() { return 1e-3 * ++n_; }
  template <std::size_t N>
  void fill(std::array<double, N>& values) {
    for (double& value : values) value = (*this)();
  }
  std::uint64_t count() { return static_cast<std::uint64_t>(++n_); }

 private:
  int n_ = 0;
};

inline constexpr HostTime kRichFirst = HostTime{Duration{5'000'000'000}};
inline constexpr UtcTime kRichUtc = UtcTime{Duration{1'700'000'000'123'456'789}};

inline TimeScale rich_scale(HostTime time) {
  TimeScale scale;
  scale.source = UtcSource::kGnss;
  scale.time = kRichFirst;
  scale.utc = kRichUtc;
  scale.sd_utc_s = 2e-3;
  scale.rate = -17e-6;
  scale.sd_rate = 3e-6;
  scale.steps = 4;
  scale.gps_minus_utc_s = 18;
  scale.pulses = {true, false, time, kRichUtc,        3e-6,         -16e-6, 2e-7,
                  4e-6, 55,    6,    {0.007, 0.0008}, {0.09, 0.001}};
  return scale;
}

inline SImuOutput rich_study(Numbers& next, HostTime time) {
  SImuOutput study;
  study.status = CalibrationStatus::kConverging;
  study.regime = Regime::kDynamic;
  study.time = time;
  study.C_b_s = {0.36, 0.48, -0.8, -0.8, 0.6, 0.0, 0.48, 0.64, 0.6};
  study.C_prior = {0, 1, 0, -1, 0, 0, 0, 0, 1};
  for (Vector3* v :
       {&study.psi_rad, &study.sd_psi_rad, &study.r_bs_b_m, &study.sd_r_bs_b_m, &study.gyro_bias_radps,
        &study.sd_gyro_bias_radps, &study.accel_bias_mps2, &study.sd_accel_bias_mps2, &study.gyro_scale,
        &study.sd_gyro_scale, &study.accel_scale, &study.sd_accel_scale, &study.accel_boresight_rad,
        &study.sd_accel_boresight_rad, &study.nis_gyro, &study.nis_accel})
    next.fill(*v);
  for (double* value : {&study.t_d_s, &study.sd_t_d_s, &study.accel_t_d_s, &study.sd_accel_t_d_s})
    *value = next();
  next.fill(study.covariance_psi_r);
  study.weakest_direction = {0.1, -0.2, 0.3, 0.4, -0.8, 0.2449};
  study.weakest_component = SImuDirection::kRY;
  study.weakest_relative_sd = 0.375;
  study.observable = {true, false, true, true, false, true};
  study.t_d_observable = true;
  SImuCounters& counters = study.counters;
  for (std::uint64_t* count :
       {&counters.samples, &counters.used, &counters.late, &counters.no_reference, &counters.waiting,
        &counters.refused_full, &counters.not_increasing, &counters.not_finite, &counters.coarse_attempts,
        &counters.resets, &counters.gated_gyro[0], &counters.gated_gyro[1], &counters.gated_gyro[2],
        &counters.gated_accel[0], &counters.gated_accel[1], &counters.gated_accel[2]})
    *count = next.count();
  return study;
}

inline NavigationOutput rich_navigation(Numbers& next, HostTime time) {
  NavigationOutput n;
  n.status = NavigationStatus::kNavigating;
  n.method = InitialisationMethod::kInMotion;
  n.time = time;
  n.utc = kRichUtc;
  n.has_utc = true;
  n.latitude_rad = 0.81;
  n.longitude_rad = 0.15;
  n.height_m = 432.1;
  n.C_b_n = {0.36, 0.48, -0.8, -0.8, 0.6, 0.0, 0.48, 0.64, 0.6};
  for (Vector3* v : {&n.v_n_mps, &n.rpy_rad, &n.gyro_bias_radps, &n.accel_bias_mps2, &n.sd_position_m,
                     &n.sd_velocity_mps, &n.sd_rpy_rad, &n.sd_gyro_bias_radps, &n.sd_accel_bias_mps2,
                     &n.nis_position, &n.nis_velocity, &n.antenna_lever_arm_b_m, &n.sd_antenna_lever_arm_m})
    next.fill(*v);
  n.has_gnss = true;
  n.gnss_time = time - std::chrono::milliseconds(300);
  n.receiver_latency_s = next();
  n.sd_receiver_latency_s = next();
  return n;
}

inline OdometryOutput rich_odometry(Numbers& next, HostTime time) {
  OdometryOutput o;
  o.enabled = o.standing = o.has_speed = true;
  o.time = time;
  for (Vector3* v : {&o.mount_rad, &o.sd_mount_rad, &o.r_bv_b_m, &o.sd_r_bv_b_m, &o.nis}) next.fill(*v);
  for (double* value : {&o.speed_mps, &o.scale, &o.sd_scale}) *value = next();
  return o;
}

/// @param tick  counts 0.25 s
inline Snapshot rich_snapshot(int tick) {
  Numbers next;
  for (int i = 0; i < 7 * tick; ++i) (void)next();
  Snapshot s{};
  s.tick = 25 * tick;
  s.cut = kRichFirst + std::chrono::milliseconds(250 * tick + 20);
  const HostTime time = kRichFirst + std::chrono::milliseconds(250 * tick);
  s.has_reference = s.has_utc = s.has_new_navigation = s.has_new_odometry = true;
  s.first_reference_time = kRichFirst;
  s.first_reference_utc = kRichUtc;
  s.n_studies = 2;
  s.time_scale = rich_scale(time);
  s.ages = {0.02, 0.32};
  s.navigation = rich_navigation(next, time - std::chrono::milliseconds(3));
  s.navigation.latitude_rad += 1e-6 * tick;
  s.navigation.longitude_rad += 3e-6 * tick;
  s.navigation.height_m += tick;
  s.odometry = rich_odometry(next, time - std::chrono::milliseconds(5));
  s.reference.counter = 4000 + tick;
  next.fill(s.reference.omega_radps);
  next.fill(s.reference.f_mps2);
  for (std::size_t i = 0; i < s.n_studies; ++i) {
    s.has_new_study[i] = true;
    s.studies[i] = rich_study(next, time - std::chrono::milliseconds(7));
  }
  EstimatorCounters& c = s.counters;
  for (std::uint64_t* count :
       {&c.gnss_used, &c.gnss_rejected, &c.gnss_positions_rejected, &c.odometry_samples,
        &c.odometry_speed_used, &c.odometry_speed_rejected, &c.odometry_slip_used, &c.odometry_slip_rejected,
        &c.zero_velocity_used, &c.zero_velocity_rejected, &c.odometry_too_old, &c.odometry_not_finite})
    *count = next.count();
  return s;
}

inline ErrorRecord rich_error(std::size_t study, int sample) {
  Numbers next;
  for (int i = 0; i < 5 * sample; ++i) (void)next();
  ErrorRecord record{};
  record.study = study;
  record.first_reference_time = kRichFirst;
  record.row.time = kRichFirst + std::chrono::milliseconds(10 * sample + (study == 0 ? 0 : 3));
  record.row.utc = rich_scale(record.row.time).at(record.row.time);
  record.row.counter = 70'000 + sample;
  record.row.regime = sample < 12 ? Regime::kStatic : Regime::kDynamic;
  record.row.gyro_valid = sample % 5 != 4;
  record.row.accel_valid = sample % 7 != 6;
  for (Vector3* v : {&record.row.e_gyro_radps, &record.row.e_accel_mps2, &record.row.predicted_omega_s_radps,
                     &record.row.predicted_f_s_mps2})
    next.fill(*v);
  record.ages = {0.02 + 1e-3 * sample, 0.3};
  record.mounting = {{0.36, 0.48, -0.8, -0.8, 0.6, 0.0, 0.48, 0.64, 0.6}, {0.1, 0.2, 0.3}};
  record.t_d_s = 2e-3;
  return record;
}

/// Two axes: the second has a fit.
inline Refit rich_refit() {
  Refit refit;
  refit.study = 1;
  refit.name = "right";
  refit.time = kRichFirst + std::chrono::seconds(60);
  refit.utc = rich_scale(refit.time).at(refit.time);
  refit.first_reference_time = kRichFirst;
  refit.samples = 6000;
  refit.duration_s = 0.75;
  AxisRefit axis;
  axis.axis = 1;
  axis.regime = Regime::kStatic;
  axis.rate_hz = 100.0;
  axis.wv.n_valid = 6000;
  axis.wv.levels.resize(2);
  axis.wv.levels[0] = {1, 2.0, 1e-6, 0.9e-6, 1.2e-6, 5999};
  axis.wv.levels[1] = {2, 4.0, 5e-7, 4e-7, 7e-7, 5997};
  refit.axes.push_back(axis);
  axis.axis = 5;
  axis.regime = Regime::kDynamic;
  noise::FitResult fit;
  fit.n = 5500;
  fit.rate_hz = 50.0;
  fit.spec = *noise::parse_model("WN+GM");
  fit.parameters.push_back({"WN", "sigma2", "(m/s^2)^2", 1.5, 0.1, 0.8, 1.2, {}});
  fit.parameters.push_back({"GM1", "beta", "1/s", 0.5, {}, {}, {}, {}});
  fit.wv.push_back({axis.wv.levels[0], 0.25, 0.0, 0.0});
  fit.wv.push_back({axis.wv.levels[1], 0.125, 0.0, 0.0});
  fit.objective = 3.5;
  fit.j_test = noise::JTest{4.5, 7, 0.72};
  fit.criterion = -2.5;
  fit.warnings = {"the slowest process is longer than the data", "another"};
  axis.fit = fit;
  axis.change = noise::JTest{61.5, 9, 7e-10};
  axis.changed = true;
  refit.axes.push_back(axis);
  refit.motion.n_static = 5;
  refit.motion.n_dynamic = 7;
  Numbers next;
  const auto fill = [&](MotionFit& fit_of) {
    for (double* value : {&fit_of.mean, &fit_of.rms, &fit_of.largest, &fit_of.slope, &fit_of.slope_sd,
                          &fit_of.correlation, &fit_of.r2, &fit_of.f, &fit_of.p_value})
      *value = next();
  };
  for (MotionFit& one : refit.motion.axes) fill(one);
  for (MotionFit& one : refit.motion.covariates) fill(one);
  return refit;
}

inline PcClockRecord::State rich_clock() {
  ClockKeeper chrony;
  chrony.name = "chrony";
  chrony.source = "162.159.200.123";
  chrony.stratum = 4;
  chrony.is_synchronised = true;
  chrony.offset_s = 12e-6;
  chrony.sd_s = 23e-6;
  chrony.max_error_s = 0.007;
  chrony.frequency_ppm = -12.5;
  ClockKeeper card;
  card.name = "/dev/ptp0";
  card.offset_s = 3e-6;
  return {{kRichFirst, kRichUtc, Duration{1500}, Duration{2'000'000'000}},
          KernelClockState{8193, true, 1e-4, -12.5, 0.02, 1e-3, 37},
          {chrony, card}};
}

}  // namespace imuscope::test
