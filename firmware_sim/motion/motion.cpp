#include "firmware_sim/motion/motion.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace imusim {
namespace {

bool inside(const std::vector<MovingSpan>& spans, double t_s) {
  const auto after = std::upper_bound(spans.begin(), spans.end(), t_s,
                                      [](double t, const MovingSpan& span) { return t < span.begin_s; });
  return after != spans.begin() && t_s <= std::prev(after)->end_s;
}

/// Velocity in n and its derivative, of a point that moves over the ellipsoid.
struct Velocity {
  Eigen::Vector3d v_n;
  Eigen::Vector3d v_dot_n;
};

Velocity velocity_over_ellipsoid(double latitude, const QuinticSpline::Point& lat,
                                 const QuinticSpline::Point& lon, const QuinticSpline::Point& height) {
  const EarthRadii radii = earth_radii(latitude);
  const double sine = std::sin(latitude);
  const double cosine = std::cos(latitude);
  const double meridian = radii.meridian_m + height.value;
  const double transverse = radii.transverse_m + height.value;
  const double meridian_dot = radii.meridian_per_rad_m * lat.first + height.first;
  const double transverse_dot = radii.transverse_per_rad_m * lat.first + height.first;
  const Eigen::Vector3d v(meridian * lat.first, transverse * cosine * lon.first, -height.first);
  const Eigen::Vector3d v_dot(meridian_dot * lat.first + meridian * lat.second,
                              transverse_dot * cosine * lon.first -
                                  transverse * sine * lat.first * lon.first +
                                  transverse * cosine * lon.second,
                              -height.second);
  return {v, v_dot};
}

/// Rate of b relative to n in b, and the derivative of its components, from the Euler angles' derivatives.
struct BodyRate {
  Eigen::Vector3d omega;
  Eigen::Vector3d omega_dot;
};

BodyRate body_rate(const QuinticSpline::Point& roll, const QuinticSpline::Point& pitch,
                   const QuinticSpline::Point& heading) {
  const double sr = std::sin(roll.value);
  const double cr = std::cos(roll.value);
  const double sp = std::sin(pitch.value);
  const double cp = std::cos(pitch.value);
  const Eigen::Vector3d omega(roll.first - heading.first * sp, pitch.first * cr + heading.first * cp * sr,
                              -pitch.first * sr + heading.first * cp * cr);
  // The heading rate seen from the rolled and pitched body, and its change.
  const double level = heading.first * cp;
  const double level_dot = heading.second * cp - heading.first * pitch.first * sp;
  const Eigen::Vector3d omega_dot(
      roll.second - heading.second * sp - heading.first * pitch.first * cp,
      pitch.second * cr - pitch.first * roll.first * sr + level_dot * sr + level * roll.first * cr,
      -pitch.second * sr - pitch.first * roll.first * cr + level_dot * cr - level * roll.first * sr);
  return {omega, omega_dot};
}

}  // namespace

Motion::Motion(const Scenario& scenario) : Motion(scenario, make_drive(scenario)) {}

Motion::Motion(const Scenario& scenario, const DriveNodes& nodes)
    : scenario_(scenario),
      latitude_offset_(nodes.step_s, nodes.latitude_offset_rad),
      longitude_offset_(nodes.step_s, nodes.longitude_offset_rad),
      height_(nodes.step_s, nodes.height_m),
      roll_(nodes.step_s, nodes.roll_rad),
      pitch_(nodes.step_s, nodes.pitch_rad),
      heading_(nodes.step_s, nodes.heading_rad),
      moving_(nodes.moving) {
  if (!scenario_.engine_runs) return;
  engine_.emplace([this](double t_s) { return undisturbed_at(t_s).v_n_mps.norm(); }, scenario_.duration_s,
                  scenario_.seed);
  vibration_.emplace(VibrationClass{}, Random(scenario_.seed, "vibration"));
}

MotionState Motion::state_at(double t_s) const {
  MotionState state = undisturbed_at(t_s);
  if (engine_) {
    const Vibration::Point vibration = vibration_->at(engine_->at(t_s));
    state.omega_nb_b_radps += vibration.omega_radps;
    state.omega_ib_b_radps += vibration.omega_radps;
    state.omega_dot_ib_b_radps2 += vibration.omega_dot_radps2;
    state.f_b_mps2 += vibration.f_mps2;
  }
  return state;
}

MotionState Motion::undisturbed_at(double t_s) const {
  const QuinticSpline::Point lat = latitude_offset_.at(t_s);
  const QuinticSpline::Point lon = longitude_offset_.at(t_s);
  const QuinticSpline::Point height = height_.at(t_s);
  const QuinticSpline::Point roll = roll_.at(t_s);
  const QuinticSpline::Point pitch = pitch_.at(t_s);
  const QuinticSpline::Point heading = heading_.at(t_s);

  MotionState state;
  state.t_s = t_s;
  state.position = {scenario_.start.latitude_rad + lat.value, scenario_.start.longitude_rad + lon.value,
                    height.value};
  const double latitude = state.position.latitude_rad;
  const Velocity velocity = velocity_over_ellipsoid(latitude, lat, lon, height);
  state.v_n_mps = velocity.v_n;
  state.roll_rad = roll.value;
  state.pitch_rad = pitch.value;
  state.heading_rad = heading.value;
  state.C_b_n = C_b_n_from_euler(roll.value, pitch.value, heading.value);

  // Earth rate and transport rate; n turns with the meridian: omega_in = ((W + l') cos L, -L', -(W + l') sin
  // L).
  const double sine = std::sin(latitude);
  const double cosine = std::cos(latitude);
  const Eigen::Vector3d omega_ie_n(kEarthRate_radps * cosine, 0.0, -kEarthRate_radps * sine);
  const Eigen::Vector3d omega_en_n(lon.first * cosine, -lat.first, -lon.first * sine);
  const Eigen::Vector3d omega_in_n = omega_ie_n + omega_en_n;
  const double spin = kEarthRate_radps + lon.first;
  const Eigen::Vector3d omega_dot_in_n(lon.second * cosine - spin * sine * lat.first, -lat.second,
                                       -lon.second * sine - spin * cosine * lat.first);

  const BodyRate rate = body_rate(roll, pitch, heading);
  const Eigen::Matrix3d C_n_b = state.C_b_n.transpose();
  const Eigen::Vector3d omega_in_b = C_n_b * omega_in_n;
  state.omega_nb_b_radps = rate.omega;
  state.omega_ib_b_radps = rate.omega + omega_in_b;
  state.omega_dot_ib_b_radps2 = rate.omega_dot + C_n_b * omega_dot_in_n - rate.omega.cross(omega_in_b);

  const Eigen::Vector3d gravity_n(0.0, 0.0, normal_gravity_mps2(latitude, height.value));
  const Eigen::Vector3d coriolis_n = (2.0 * omega_ie_n + omega_en_n).cross(velocity.v_n);
  state.f_b_mps2 = C_n_b * (velocity.v_dot_n + coriolis_n - gravity_n);
  return state;
}

Regime Motion::regime_at(double t_s) const {
  return inside(moving_, t_s) ? Regime::kDynamic : Regime::kStatic;
}

Eigen::Matrix3d C_b_n_from_euler(double roll_rad, double pitch_rad, double heading_rad) {
  return (Eigen::AngleAxisd(heading_rad, Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(pitch_rad, Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(roll_rad, Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

Eigen::Vector3d specific_force_at(const MotionState& state, const Eigen::Vector3d& r_b_m) {
  const Eigen::Vector3d& omega = state.omega_ib_b_radps;
  return state.f_b_mps2 + state.omega_dot_ib_b_radps2.cross(r_b_m) + omega.cross(omega.cross(r_b_m));
}

GeodeticPosition position_at(const MotionState& state, const Eigen::Vector3d& r_b_m) {
  return displaced(state.position, state.C_b_n * r_b_m);
}

Eigen::Vector3d velocity_at(const MotionState& state, const Eigen::Vector3d& r_b_m) {
  // Relative to the Earth: omega_eb = omega_ib - omega_ie.
  const double latitude = state.position.latitude_rad;
  const Eigen::Vector3d omega_ie_n(kEarthRate_radps * std::cos(latitude), 0.0,
                                   -kEarthRate_radps * std::sin(latitude));
  const Eigen::Vector3d omega_eb_b = state.omega_ib_b_radps - state.C_b_n.transpose() * omega_ie_n;
  return state.v_n_mps + state.C_b_n * omega_eb_b.cross(r_b_m);
}

}  // namespace imusim
