#include "service/run/telemetry.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "base/units.h"
#include "estimation/navigation/gravity.h"
#include "estimation/navigation/wgs84.h"
#include "publish/message_values.h"
#include "sample/eigen_arrays.h"
#include "sample/gps_time.h"
#include "service/pipeline/noise_series.h"
#include "service/pipeline/observability.h"
#include "service/run/mounting_quaternion.h"

namespace imuscope {

namespace {

constexpr double kPercent = 100.0;

std::int64_t as_count(std::uint64_t count) { return static_cast<std::int64_t>(count); }

/// Three fields of a message, x, y, z of one vector.
struct Fields {
  double& x;
  double& y;
  double& z;
  void set(const Vector3& v, double unit = 1.0) const {
    x = v[0] * unit;
    y = v[1] * unit;
    z = v[2] * unit;
  }
};

/// What every message of a refit begins with.
template <typename Message>
Message stamped(Message message, const Refit& refit) {
  message.utime = utime_of(refit.utc);
  message.name = refit.name;
  message.time_s = to_seconds(refit.time - refit.first_reference_time);
  return message;
}

axis_wavelet_variance_t axis_message(const AxisRefit& refit) {
  axis_wavelet_variance_t message{};
  message.axis = axis_name(refit.axis);
  message.regime = regime_name(refit.regime);
  message.unit = axis_unit(refit.axis);
  message.n = as_count(refit.wv.n_valid);
  message.rate_hz = refit.rate_hz;
  message.n_levels = element_count(refit.wv.levels);
  for (const noise::WvLevel& level : refit.wv.levels) {
    message.level.push_back(level.level);
    message.tau_s.push_back(level.tau_samples / refit.rate_hz);
    message.value.push_back(level.value);
    message.ci_low.push_back(level.ci_low);
    message.ci_high.push_back(level.ci_high);
    message.n_coefficients.push_back(as_count(level.n_coefficients));
  }
  return message;
}

noise_parameter_t parameter_message(const noise::ParameterEstimate& parameter) {
  noise_parameter_t message{};
  message.process = parameter.process;
  message.name = parameter.name;
  message.unit = parameter.unit;
  message.value = parameter.value;
  message.sd = parameter.sd.value_or(kUnknown);
  message.ci_low = parameter.ci_low.value_or(kUnknown);
  message.ci_high = parameter.ci_high.value_or(kUnknown);
  return message;
}

axis_noise_model_t model_message(const AxisRefit& refit) {
  const noise::FitResult& fit = *refit.fit;
  axis_noise_model_t message{};
  message.axis = axis_name(refit.axis);
  message.regime = regime_name(refit.regime);
  message.unit = axis_unit(refit.axis);
  message.n = as_count(fit.n);
  message.rate_hz = fit.rate_hz;
  message.model = fit.spec.name();
  message.weights = fit.weighting == noise::Weighting::kOptimal ? "optimal" : "ci";
  message.intervals = fit.intervals == noise::Intervals::kQuick ? "quick" : "inverted";
  message.n_parameters = element_count(fit.parameters);
  for (const auto& parameter : fit.parameters) message.parameters.push_back(parameter_message(parameter));
  message.n_levels = element_count(fit.wv);
  for (const noise::FittedLevel& level : fit.wv) {
    message.tau_s.push_back(level.observed.tau_samples / fit.rate_hz);
    message.fitted.push_back(level.fitted);
  }
  message.objective = fit.objective;
  message.j_statistic = fit.j_test ? fit.j_test->statistic : kUnknown;
  message.j_dof = fit.j_test ? fit.j_test->dof : kUnknown;
  message.j_p_value = fit.j_test ? fit.j_test->p_value : kUnknown;
  message.criterion = fit.criterion;
  message.change_statistic = refit.change ? refit.change->statistic : kUnknown;
  message.change_dof = refit.change && refit.change->dof > 0 ? refit.change->dof : kUnknown;
  message.change_p_value = refit.change ? refit.change->p_value : kUnknown;
  message.changed = static_cast<std::int8_t>(refit.changed);
  message.identifiable = static_cast<std::int8_t>(fit.identifiable);
  message.n_warnings = element_count(fit.warnings);
  message.warnings = fit.warnings;
  return message;
}

axis_dynamics_t axis_motion(std::size_t axis, const MotionFit& fit) {
  axis_dynamics_t m{};
  m.axis = axis_name(axis);
  m.unit = axis_unit(axis);
  m.mean = fit.mean;
  m.rms = fit.rms;
  m.largest = fit.largest;
  m.slope = fit.slope;
  m.slope_sd = fit.slope_sd;
  m.correlation = fit.correlation;
  m.r2 = fit.r2;
  m.f = fit.f;
  m.p_value = fit.p_value;
  return m;
}

void set_values(const SImuOutput& study, calibration_t& m) {
  const Eigen::Quaterniond q = mounting_quaternion(study.C_b_s);
  m.q_w = q.w();
  m.q_x = q.x();
  m.q_y = q.y();
  m.q_z = q.z();
  Fields{m.psi_x_deg, m.psi_y_deg, m.psi_z_deg}.set(study.psi_rad, kDegPerRad);
  Fields{m.r_x_m, m.r_y_m, m.r_z_m}.set(study.r_bs_b_m);
  m.t_d_ms = study.t_d_s * kMsPerS;
  Fields{m.bg_x_radps, m.bg_y_radps, m.bg_z_radps}.set(study.gyro_bias_radps);
  Fields{m.ba_x_mps2, m.ba_y_mps2, m.ba_z_mps2}.set(study.accel_bias_mps2);
  Fields{m.sg_x, m.sg_y, m.sg_z}.set(study.gyro_scale);
  Fields{m.sa_x, m.sa_y, m.sa_z}.set(study.accel_scale);
}

void set_sds(const SImuOutput& study, calibration_t& m) {
  Fields{m.sd_psi_x_deg, m.sd_psi_y_deg, m.sd_psi_z_deg}.set(study.sd_psi_rad, kDegPerRad);
  Fields{m.sd_r_x_m, m.sd_r_y_m, m.sd_r_z_m}.set(study.sd_r_bs_b_m);
  m.sd_t_d_ms = study.sd_t_d_s * kMsPerS;
  Fields{m.sd_bg_x_radps, m.sd_bg_y_radps, m.sd_bg_z_radps}.set(study.sd_gyro_bias_radps);
  Fields{m.sd_ba_x_mps2, m.sd_ba_y_mps2, m.sd_ba_z_mps2}.set(study.sd_accel_bias_mps2);
  Fields{m.sd_sg_x, m.sd_sg_y, m.sd_sg_z}.set(study.sd_gyro_scale);
  Fields{m.sd_sa_x, m.sd_sa_y, m.sd_sa_z}.set(study.sd_accel_scale);
}

/// Where the motion has shown nothing of a state, its number would say something that nobody knows.
void set_observability(const SImuOutput& study, calibration_t& m) {
  const Observability observability = observability_of(study);
  const std::array<double*, kObservedStates> values{&m.psi_x_deg, &m.psi_y_deg, &m.psi_z_deg, &m.r_x_m,
                                                    &m.r_y_m,     &m.r_z_m,     &m.t_d_ms};
  const std::array<std::int8_t*, kObservedStates> shown{
      &m.psi_x_observable, &m.psi_y_observable, &m.psi_z_observable, &m.r_x_observable,
      &m.r_y_observable,   &m.r_z_observable,   &m.t_d_observable};
  for (std::size_t i = 0; i < kObservedStates; ++i) {
    const bool observable = observability.states[i].observable;
    *shown[i] = static_cast<std::int8_t>(observable);
    if (!observable) *values[i] = kUnknown;
  }
  m.goal_sd_psi_deg = study.goal.boresight_sd_rad * kDegPerRad;
  m.goal_sd_r_m = study.goal.lever_arm_sd_m;
  m.goal_sd_t_d_ms = study.goal.time_offset_sd_s * kMsPerS;
  m.weakest_direction = observability.weakest;
  m.weakest_relative_sd = observability.weakest_relative_sd;
  m.advice = observability.advice;
}

/// The frames of pose_t and ins_t: body forward-left-up (F), local east-north-up (U).
struct BridgeFrames {
  explicit BridgeFrames(const NavigationOutput& navigation) : C_b_n(to_eigen(navigation.C_b_n)) {
    C_n_U << 0, 1, 0, 1, 0, 0, 0, 0, -1;
  }
  /// Rotates body to local; w, x, y, z.
  [[nodiscard]] std::array<double, 4> q_F_U() const {
    const Eigen::Quaterniond q(Eigen::Matrix3d(C_n_U * C_b_n * C_b_F.transpose()));
    return {q.w(), q.x(), q.y(), q.z()};
  }
  [[nodiscard]] Eigen::Vector3d position_U_m(const NavigationOutput& navigation,
                                             const NavigationOutput& origin) const {
    return C_n_U * ned_offset({origin.latitude_rad, origin.longitude_rad, origin.height_m},
                              {navigation.latitude_rad, navigation.longitude_rad, navigation.height_m});
  }
  Eigen::Matrix3d C_b_n;
  Eigen::Matrix3d C_b_F = Eigen::Vector3d(1.0, -1.0, -1.0).asDiagonal();
  Eigen::Matrix3d C_n_U;
};

void copy(const Eigen::Vector3d& from, double (&to)[3]) { std::copy(from.begin(), from.end(), to); }

template <typename Message>
void set_freshness(const DataAges& ages, Validity validity, Message& message) {
  message.validity = static_cast<std::int8_t>(validity);
  message.reference_age_s = ages.reference_s;
  message.gnss_age_s = ages.gnss_s;
}

error_row_t error_row_message(const ErrorRecord& record) {
  constexpr Vector3 kUnknownVector{kUnknown, kUnknown, kUnknown};
  const ErrorRow& row = record.row;
  error_row_t m{};
  m.utime = utime_of(row.utc);
  m.time_s = to_seconds(row.time - record.first_reference_time);
  m.counter = row.counter;
  Fields{m.e_gyro_x_radps, m.e_gyro_y_radps, m.e_gyro_z_radps}.set(row.gyro_valid ? row.e_gyro_radps
                                                                                  : kUnknownVector);
  Fields{m.e_accel_x_mps2, m.e_accel_y_mps2, m.e_accel_z_mps2}.set(row.accel_valid ? row.e_accel_mps2
                                                                                   : kUnknownVector);
  return m;
}

constexpr double kBatch_s = 0.1;
/// Rows wait for their reference a tenth of a second, and a stalled core or line brings them later still.
constexpr double kBatchWaits_s = 1.0;

}  // namespace

std::int64_t utime_of(const UtcStamp& stamp) { return stamp.is_known ? to_utime(stamp.utc) : 0; }

navigation_t navigation_message(const Snapshot& snapshot) {
  const NavigationOutput& navigation = snapshot.navigation;
  const UtcStamp utc = snapshot.time_scale.at(navigation.time);
  const GpsTime gps = gps_time(utc.utc, utc.gps_minus_utc_s);
  navigation_t m{};
  m.utime = utime_of(utc);
  m.gps_week = utc.is_known ? gps.week : 0;
  m.gps_tow_s = utc.is_known ? gps.tow_s : kUnknown;
  m.time_s = to_seconds(navigation.time - snapshot.first_reference_time);
  m.lat_deg = navigation.latitude_rad * kDegPerRad;
  m.lon_deg = navigation.longitude_rad * kDegPerRad;
  m.height_m = navigation.height_m;
  Fields{m.v_n_mps, m.v_e_mps, m.v_d_mps}.set(navigation.v_n_mps);
  Fields{m.roll_deg, m.pitch_deg, m.heading_deg}.set(navigation.rpy_rad, kDegPerRad);
  Fields{m.sd_n_m, m.sd_e_m, m.sd_d_m}.set(navigation.sd_position_m);
  Fields{m.sd_v_n_mps, m.sd_v_e_mps, m.sd_v_d_mps}.set(navigation.sd_velocity_mps);
  Fields{m.sd_roll_deg, m.sd_pitch_deg, m.sd_heading_deg}.set(navigation.sd_rpy_rad, kDegPerRad);
  set_freshness(snapshot.ages, validity_of(navigation, snapshot.ages), m);
  return m;
}

odometry_t odometry_message(const Snapshot& snapshot) {
  const OdometryOutput& odometry = snapshot.odometry;
  const EstimatorCounters& counters = snapshot.counters;
  odometry_t m{};
  m.utime = utime_of(snapshot.time_scale.at(odometry.time));
  m.time_s = to_seconds(odometry.time - snapshot.first_reference_time);
  m.speed_mps = odometry.speed_mps;
  m.standing = static_cast<std::int8_t>(odometry.standing);
  m.zero_velocity = static_cast<std::int8_t>(odometry.resting);
  m.lost = static_cast<std::int8_t>(odometry.lost);
  m.scale_percent = odometry.scale * kPercent;
  m.sd_scale_percent = odometry.sd_scale * kPercent;
  m.mount_y_deg = odometry.mount_rad[1] * kDegPerRad;
  m.mount_z_deg = odometry.mount_rad[2] * kDegPerRad;
  m.sd_mount_y_deg = odometry.sd_mount_rad[1] * kDegPerRad;
  m.sd_mount_z_deg = odometry.sd_mount_rad[2] * kDegPerRad;
  Fields{m.axle_x_m, m.axle_y_m, m.axle_z_m}.set(odometry.r_bv_b_m);
  Fields{m.sd_axle_x_m, m.sd_axle_y_m, m.sd_axle_z_m}.set(odometry.sd_r_bv_b_m);
  Fields{m.nis_speed, m.nis_sideways, m.nis_upwards}.set(odometry.nis);
  m.speed_used = as_count(counters.odometry_speed_used);
  m.speed_rejected = as_count(counters.odometry_speed_rejected);
  m.non_holonomic_used = as_count(counters.odometry_slip_used);
  m.non_holonomic_rejected = as_count(counters.odometry_slip_rejected);
  m.zero_velocity_used = as_count(counters.zero_velocity_used);
  m.zero_velocity_rejected = as_count(counters.zero_velocity_rejected);
  return m;
}

namespace {

clock_keeper_t keeper_message(const ClockKeeper& keeper) {
  clock_keeper_t m{};
  m.name = keeper.name;
  m.source = keeper.source;
  m.stratum = keeper.stratum;
  m.is_synchronised = static_cast<std::int8_t>(keeper.is_synchronised);
  m.offset_s = keeper.offset_s;
  m.sd_s = keeper.sd_s;
  m.max_error_s = keeper.max_error_s;
  m.frequency_ppm = keeper.frequency_ppm;
  return m;
}

}  // namespace

pc_clock_t pc_clock_message(const PcClockLog::News& news, UtcTime utc) {
  const PcClockReading& reading = news.state.reading;
  const auto& kernel = news.state.kernel;
  pc_clock_t m{};
  m.utime = to_utime(utc);
  m.host_ns = to_ns(reading.host);
  m.wall_ns = reading.wall.time_since_epoch().count();
  m.step_s = news.step ? news.step->size_s : 0.0;
  m.suspended_s = news.suspend ? news.suspend->length_s : 0.0;
  for (const ClockKeeper& keeper : news.state.keepers) m.keepers.push_back(keeper_message(keeper));
  m.n_keepers = element_count(m.keepers);
  m.is_known = static_cast<std::int8_t>(kernel.has_value());
  m.offset_s = m.frequency_ppm = m.max_error_s = m.estimated_error_s = kUnknown;
  if (!kernel) return m;
  m.is_synchronised = static_cast<std::int8_t>(kernel->is_synchronised);
  m.status = kernel->status;
  m.offset_s = kernel->offset_s;
  m.frequency_ppm = kernel->frequency_ppm;
  m.max_error_s = kernel->max_error_s;
  m.estimated_error_s = kernel->estimated_error_s;
  m.tai_minus_utc_s = kernel->tai_minus_utc_s;
  return m;
}

calibration_t calibration_message(const Snapshot& snapshot, std::size_t study, const std::string& name) {
  const SImuOutput& estimate = snapshot.studies[study];
  calibration_t m{};
  m.utime = utime_of(snapshot.time_scale.at(estimate.time + from_seconds(estimate.t_d_s)));
  m.name = name;
  m.time_s = to_seconds(estimate.time - snapshot.first_reference_time);
  set_values(estimate, m);
  set_sds(estimate, m);
  set_observability(estimate, m);
  set_freshness(snapshot.ages, validity_of(estimate, snapshot.ages), m);
  return m;
}

MessageTenth::MessageTenth(double time_s)
    : number_(static_cast<std::int64_t>(std::floor(time_s / kBatch_s))) {}

bool MessageTenth::is_old(double time_s) const {
  return time_s >= kBatch_s * static_cast<double>(number_ + 1) + kBatchWaits_s;
}

std::optional<error_t> ErrorBatch::add(const ErrorRecord& record) {
  const double time_s = to_seconds(record.row.time - record.first_reference_time);
  const auto validity = static_cast<std::int8_t>(record.validity);
  const auto regime = regime_name(record.row.regime);
  std::optional<error_t> whole;
  if (pending_ && (MessageTenth(time_s) != tenth_ || pending_->validity != validity ||
                   pending_->regime != regime || pending_->rows.size() == kRowsMax))
    whole = take();
  if (!pending_) {
    pending_.emplace();
    pending_->name = name_;
    pending_->regime = regime;
    set_freshness(record.ages, record.validity, *pending_);
    tenth_ = MessageTenth(time_s);
  }
  pending_->rows.push_back(error_row_message(record));
  // fmax() passes over NaN: an age that one row knows counts.
  pending_->reference_age_s = std::fmax(pending_->reference_age_s, record.ages.reference_s);
  pending_->gnss_age_s = std::fmax(pending_->gnss_age_s, record.ages.gnss_s);
  return whole;
}

std::optional<error_t> ErrorBatch::take() {
  if (!pending_) return std::nullopt;
  error_t whole = std::move(*pending_);
  pending_.reset();
  whole.utime = whole.rows.front().utime;
  whole.n_rows = element_count(whole.rows);
  return whole;
}

std::optional<error_t> ErrorBatch::take_old(double time_s) {
  return pending_ && tenth_.is_old(time_s) ? take() : std::nullopt;
}

wavelet_variance_t wavelet_variance_message(const Refit& refit) {
  auto m = stamped(wavelet_variance_t{}, refit);
  for (const AxisRefit& axis : refit.axes) m.axes.push_back(axis_message(axis));
  m.n_axes = element_count(m.axes);
  return m;
}

noise_model_t noise_model_message(const Refit& refit) {
  auto m = stamped(noise_model_t{}, refit);
  for (const AxisRefit& axis : refit.axes) {
    if (axis.fit) m.models.push_back(model_message(axis));
  }
  m.n_models = element_count(m.models);
  return m;
}

dynamics_t dynamics_message(const Refit& refit) {
  auto m = stamped(dynamics_t{}, refit);
  const MotionSummary& motion = refit.motion;
  m.n_static = motion.n_static;
  m.n_dynamic = motion.n_dynamic;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis)
    m.axes.push_back(axis_motion(axis, motion.axes[axis]));
  m.n_axes = element_count(m.axes);
  if (motion.n_dynamic == 0) return m;
  for (std::size_t i = 0; i < kCovariates; ++i) {
    covariate_motion_t covariate{};
    covariate.name = covariate_name(i);
    covariate.unit = covariate_unit(i);
    covariate.mean = motion.covariates[i].mean;
    covariate.rms = motion.covariates[i].rms;
    covariate.largest = motion.covariates[i].largest;
    m.covariates.push_back(std::move(covariate));
  }
  m.n_covariates = element_count(m.covariates);
  return m;
}

pose_t pose_message(const Snapshot& snapshot, const Snapshot& origin) {
  const NavigationOutput& navigation = snapshot.navigation;
  const BridgeFrames frames(navigation);
  const Eigen::Matrix3d C_n_b = frames.C_b_n.transpose();
  const Eigen::Vector3d omega_ib_b =
      to_eigen(snapshot.reference.omega_radps) - to_eigen(navigation.gyro_bias_radps);
  const Eigen::Vector3d f_b = to_eigen(snapshot.reference.f_mps2) - to_eigen(navigation.accel_bias_mps2);
  const Eigen::Vector3d omega_ie_n = earth_rate_n(navigation.latitude_rad);
  const Eigen::Vector3d g_n(0.0, 0.0, normal_gravity(navigation.latitude_rad, navigation.height_m).g_mps2);
  pose_t m{};
  m.utime = utime_of(snapshot.time_scale.at(navigation.time));
  copy(frames.position_U_m(navigation, origin.navigation), m.pos);
  copy(frames.C_b_F * C_n_b * to_eigen(navigation.v_n_mps), m.vel);
  const auto q = frames.q_F_U();
  std::copy(q.begin(), q.end(), m.orientation);
  copy(frames.C_b_F * (omega_ib_b - C_n_b * omega_ie_n), m.rotation_rate);
  copy(frames.C_b_F * (f_b + C_n_b * g_n), m.accel);
  return m;
}

ins_t ins_message(const Snapshot& snapshot, const Snapshot& origin) {
  const NavigationOutput& navigation = snapshot.navigation;
  const BridgeFrames frames(navigation);
  ins_t m{};
  m.utime = utime_of(snapshot.time_scale.at(navigation.time));
  m.device_time = snapshot.reference.counter;
  copy(frames.C_b_F * to_eigen(snapshot.reference.omega_radps), m.gyro);
  copy(frames.C_b_F * to_eigen(snapshot.reference.f_mps2), m.accel);
  const auto q = frames.q_F_U();
  std::copy(q.begin(), q.end(), m.quat);
  m.rel_alt = frames.position_U_m(navigation, origin.navigation)[2];
  return m;
}

}  // namespace imuscope
