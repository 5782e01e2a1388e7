#include "firmware_sim/imu/imu_model.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

namespace imusim {
namespace {

// The low-pass sees the motion as straight lines between points this close.
constexpr double kFilterStep_s = 0.001;

std::array<NoiseSource, 3> noise_sources(const TriadErrors& errors, RegimeSwitch regime_switch,
                                         std::uint64_t seed, const std::string& stream) {
  const auto axis = [&](std::size_t i) {
    return NoiseSource(errors.noise[i], regime_switch, Random(seed, stream + "xyz"[i]));
  };
  return {axis(0), axis(1), axis(2)};
}

/// Butterworth low-pass of second order over one step, exact for an input that runs straight from `before` to
/// `now`: y" + 2 a y' + 2 a^2 (y - u) = 0 with a = omega_c / sqrt(2) follows the line by 1 / a, and what is
/// left dies away as exp(-a t), turning with a t.
void low_pass(Eigen::Vector3d& output, Eigen::Vector3d& slope_per_s, const Eigen::Vector3d& before,
              const Eigen::Vector3d& now, double step_s, double corner_hz) {
  if (!std::isfinite(corner_hz)) {
    output = now;
    return;
  }
  const double a_per_s = std::numbers::sqrt2 * std::numbers::pi * corner_hz;
  const Eigen::Vector3d line_per_s = (now - before) / step_s;
  const Eigen::Vector3d behind = line_per_s / a_per_s;
  const Eigen::Vector3d left = output - (before - behind);
  const Eigen::Vector3d left_per_s = slope_per_s - line_per_s;
  const double decay = std::exp(-a_per_s * step_s);
  const double cosine = decay * std::cos(a_per_s * step_s);
  const double sine = decay * std::sin(a_per_s * step_s);
  output = now - behind + cosine * left + sine * (left_per_s / a_per_s + left);
  slope_per_s = line_per_s + cosine * left_per_s - sine * (left_per_s + 2.0 * a_per_s * left);
}

Eigen::Vector3d clipped_and_quantised(const Eigen::Vector3d& value, const TriadErrors& errors) {
  Eigen::Vector3d result = value.cwiseMin(errors.range).cwiseMax(-errors.range);
  if (errors.quantisation > 0.0)
    for (double& axis : result) axis = errors.quantisation * std::round(axis / errors.quantisation);
  return result;
}

Eigen::Vector3d next_noise(std::array<NoiseSource, 3>& sources, Regime regime, double step_s,
                           double white_factor) {
  const double x = sources[0].next(regime, step_s, white_factor);
  const double y = sources[1].next(regime, step_s, white_factor);
  const double z = sources[2].next(regime, step_s, white_factor);
  return {x, y, z};
}

Eigen::Vector3d with_errors(const Eigen::Vector3d& truth, const Eigen::Vector3d& f,
                            const Eigen::Vector3d& noise, const TriadErrors& errors) {
  const Eigen::Vector3d u = errors.C_s_triad * truth;
  return clipped_and_quantised(u + errors.scale.cwiseProduct(u) + errors.misalignment * u +
                                   errors.g_sensitivity * f + errors.bias + noise,
                               errors);
}

}  // namespace

Eigen::Matrix3d triad_matrix(const TriadErrors& errors) {
  Eigen::Matrix3d matrix = errors.misalignment;
  matrix.diagonal() += Eigen::Vector3d::Ones() + errors.scale;
  return matrix * errors.C_s_triad;
}

Eigen::Matrix3d triad_frame(const Eigen::Matrix3d& triad) {
  Eigen::Matrix3d frame;
  frame.row(0) = triad.row(0).normalized();
  frame.row(1) = (triad.row(1) - triad.row(1).dot(frame.row(0)) * frame.row(0)).normalized();
  frame.row(2) = frame.row(0).cross(frame.row(1));
  return frame;
}

double slow_delay_s(const TriadErrors& errors) {
  return errors.delay_s + 1.0 / (std::numbers::sqrt2 * std::numbers::pi * errors.low_pass_hz);
}

double Temperature::at(double t_s) const {
  return begin_degC - (end_degC - begin_degC) * std::expm1(-t_s / time_constant_s);
}

IdealReading ideal_reading(const MotionState& state, const Mounting& mounting) {
  return {mounting.C_b_s * state.omega_ib_b_radps,
          mounting.C_b_s * specific_force_at(state, mounting.r_bs_b_m)};
}

Eigen::Vector3d size_effect(const MotionState& state, const Mounting& mounting,
                            const Eigen::Matrix3d& places_s_m) {
  const Eigen::Vector3d omega_s = mounting.C_b_s * state.omega_ib_b_radps;
  const Eigen::Vector3d omega_dot_s = mounting.C_b_s * state.omega_dot_ib_b_radps2;
  Eigen::Vector3d effect;
  for (Eigen::Index i = 0; i < 3; ++i) {
    const Eigen::Vector3d place = places_s_m.col(i);
    effect(i) = (omega_dot_s.cross(place) + omega_s.cross(omega_s.cross(place)))(i);
  }
  return effect;
}

ImuModel::ImuModel(const Motion& motion, const Mounting& mounting, const ImuErrors& errors,
                   std::uint64_t seed, std::string_view name)
    : motion_(&motion),
      mounting_(mounting),
      errors_(errors),
      gyro_noise_(noise_sources(errors.gyro, errors.regime_switch, seed, std::string(name) + "/gyro_")),
      accel_noise_(noise_sources(errors.accel, errors.regime_switch, seed, std::string(name) + "/accel_")) {
  if (motion.engine() != nullptr && errors.own_vibration > 0.0)
    own_vibration_.emplace(VibrationClass{}.times(errors.own_vibration),
                           Random(seed, std::string(name) + "/vibration"));
  disturbed_ = own_vibration_.has_value() || errors.gyro.delay_s != 0.0 || errors.accel.delay_s != 0.0 ||
               !errors.accel_places_s_m.isZero(0.0);
}

/// What reaches the low-pass at t_s.
IdealReading ImuModel::input_at(double t_s) const {
  const auto felt_at = [this](double then_s) {
    const MotionState state = motion_->state_at(then_s);
    IdealReading felt = ideal_reading(state, mounting_);
    felt.f_mps2 += size_effect(state, mounting_, errors_.accel_places_s_m);
    if (own_vibration_) {
      const Vibration::Point own = own_vibration_->at(motion_->engine()->at(then_s));
      felt.omega_radps += own.omega_radps;
      felt.f_mps2 += own.f_mps2;
    }
    return felt;
  };
  IdealReading input = felt_at(t_s - errors_.gyro.delay_s);
  if (errors_.accel.delay_s != errors_.gyro.delay_s)
    input.f_mps2 = felt_at(t_s - errors_.accel.delay_s).f_mps2;
  return input;
}

IdealReading ImuModel::through_low_pass(const IdealReading& now, double t_s) {
  const double gyro_hz = errors_.gyro.low_pass_hz;
  const double accel_hz = errors_.accel.low_pass_hz;
  if (!std::isfinite(gyro_hz) && !std::isfinite(accel_hz)) return now;
  if (!has_last_) {
    last_input_ = filtered_ = now;
    filtered_slope_ = {Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
    return now;
  }
  const double span_s = t_s - last_t_s_;
  const int steps = std::max(1, static_cast<int>(std::ceil(span_s / kFilterStep_s)));
  const double step_s = span_s / steps;
  for (int k = 1; k <= steps; ++k) {
    const IdealReading input = k == steps ? now : input_at(last_t_s_ + k * step_s);
    low_pass(filtered_.omega_radps, filtered_slope_.omega_radps, last_input_.omega_radps, input.omega_radps,
             step_s, gyro_hz);
    low_pass(filtered_.f_mps2, filtered_slope_.f_mps2, last_input_.f_mps2, input.f_mps2, step_s, accel_hz);
    last_input_ = input;
  }
  return filtered_;
}

ImuReading ImuModel::sample_at(double t_s) {
  const IdealReading ideal = ideal_reading(motion_->state_at(t_s), mounting_);
  const IdealReading input = disturbed_ ? input_at(t_s) : ideal;
  return sample_of(ideal, through_low_pass(input, t_s), motion_->regime_at(t_s), t_s);
}

ImuReading ImuModel::sample_of(const IdealReading& ideal, const IdealReading& seen, Regime regime,
                               double t_s) {
  const double step_s = has_last_ ? t_s - last_t_s_ : 0.0;
  const double warmer_degC = errors_.temperature.at(t_s) - errors_.temperature.begin_degC;
  const double gyro_white_factor = std::exp(errors_.gyro_white.per_degC * warmer_degC +
                                            errors_.gyro_white.per_radps * ideal.omega_radps.norm());
  const Eigen::Vector3d gyro_noise = next_noise(gyro_noise_, regime, step_s, gyro_white_factor);
  const Eigen::Vector3d accel_noise = next_noise(accel_noise_, regime, step_s, 1.0);
  last_t_s_ = t_s;
  has_last_ = true;

  ImuReading reading;
  reading.omega_radps = with_errors(seen.omega_radps, seen.f_mps2, gyro_noise, errors_.gyro);
  reading.f_mps2 = with_errors(seen.f_mps2, seen.f_mps2, accel_noise, errors_.accel);
  reading.gyro_error_radps = reading.omega_radps - ideal.omega_radps;
  reading.accel_error_mps2 = reading.f_mps2 - ideal.f_mps2;
  return reading;
}

}  // namespace imusim
