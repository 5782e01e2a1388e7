/// Everything that the functions of navigation return, at a few rich places: what is right about it, the tests beside
/// this one prove against closed forms and differences.

#include <gtest/gtest.h>
#include <array>
#include <cmath>
#include <complex>
#include <limits>
#include <vector>

#include "estimation/navigation/antenna.h"
#include "estimation/navigation/error_model.h"
#include "estimation/navigation/gnss_gate.h"
#include "estimation/navigation/gnss_measurement.h"
#include "estimation/navigation/gravity.h"
#include "estimation/navigation/heading_solver.h"
#include "estimation/navigation/initial_alignment.h"
#include "estimation/navigation/odometry_measurement.h"
#include "estimation/navigation/strapdown.h"
#include "estimation/navigation/wgs84.h"
#include "tests/estimation/navigation/random_states.h"
#include "tests/support/answer.h"
#include "tests/support/recorded_answer.h"

namespace imuscope {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using test::Answer;

/// Elements of a matrix may be smaller than what counts as nothing elsewhere: only zero is.
constexpr double kNothing = 1e-22;

HostTime instant(double seconds) { return HostTime{from_seconds(seconds)}; }

NavigationState state_of(double latitude_deg, double longitude_deg, double height_m) {
  NavigationState state;
  state.position = {latitude_deg * kRadPerDeg, longitude_deg * kRadPerDeg, height_m};
  state.v_n_mps = {21.0, -13.0, 1.7};
  state.C_b_n = exp_so3({0.4, -0.7, 2.1});
  state.gyro_bias_b_radps = {1e-3, -2e-3, 3e-3};
  state.accel_bias_b_mps2 = {0.03, -0.02, 0.05};
  return state;
}

const InertialRates kRates{{0.11, -0.23, 0.37}, {1.3, -2.1, -9.2}};
const std::array kPlaces{state_of(46.5, 6.6, 420.0), state_of(-33.9, 151.2, 20.0),
                         state_of(68.0, -133.0, 2900.0)};

void add_position(Answer& lines, std::string_view name, const GeodeticPosition& position) {
  lines.line(name, 1e3 * position.latitude_rad, 1e3 * position.longitude_rad, position.height_m);
}

void add_state(Answer& lines, const NavigationState& state) {
  add_position(lines, "position", state.position);
  lines.line("velocity", state.v_n_mps);
  lines.line("attitude", state.C_b_n);
  lines.line("biases", state.gyro_bias_b_radps, state.accel_bias_b_mps2);
}

TEST(NavigationAnswers, Rotations) {
  Answer lines;
  for (const Vector3d& phi :
       {Vector3d(0.0, 0.0, 0.0), Vector3d(4e-4, -5e-4, 3e-4), Vector3d(8e-4, -9e-4, 4e-4),
        Vector3d(0.3, -0.2, 0.9), Vector3d(1.7, 2.1, -1.5), Vector3d(3.0, -0.9, 0.1)}) {
    const Matrix3d C = exp_so3(phi);
    lines.line("exp", C);
    lines.line("log", log_so3(C));
    const Eigen::Quaterniond q = quaternion_from_rotation(C);
    lines.line("quaternion", q.w(), q.vec());
    const EulerAngles angles = euler_from_rotation(C);
    lines.line("angles", angles.roll_rad, angles.pitch_rad, angles.heading_rad);
    Matrix3d bent = C;
    bent(0, 1) += 0.02;
    bent(2, 1) -= 0.01;
    lines.line("nearest", reorthonormalized(bent));
    lines.line("tidied", tidied(bent));
  }
  for (const double pitch : {1.570796326, -1.570796326, 0.5 * kPi, -0.5 * kPi}) {
    const EulerAngles angles = euler_from_rotation(rotation_from_euler({0.3, pitch, 1.1}));
    lines.line("upright", angles.roll_rad, angles.pitch_rad, angles.heading_rad);
  }
  for (const double angle : {-9.0, -3.2, -3.1, 0.5, 3.1, 3.2, 12.0})
    lines.line("wrapped", wrapped_angle(angle));
  test::expect_recorded("estimation/navigation/rotations.txt", lines.text(), test::kShareOfNumber, 1e-8);
}

TEST(NavigationAnswers, AngleOfHalfATurnIsPositiveWhicheverSideItComesFrom) {
  EXPECT_EQ(wrapped_angle(kPi), kPi);
  EXPECT_EQ(wrapped_angle(-kPi), kPi);
  EXPECT_EQ(wrapped_angle(3.0 * kPi), kPi);
}

TEST(NavigationAnswers, Earth) {
  Answer lines;
  for (const double latitude_deg : {-71.0, -33.0, 0.0, 12.0, 46.5, 85.0}) {
    for (const double height_m : {-50.0, 1200.0}) {
      const GeodeticPosition at{latitude_deg * kRadPerDeg, -1.9, height_m};
      const Gravity gravity = normal_gravity(at.latitude_rad, height_m);
      const Curvature k = curvature_at(at.latitude_rad);
      lines.line("gravity", gravity.g_mps2, gravity.latitude_slope_mps2, gravity.height_slope_per_s2);
      lines.line("curvature", k.meridian_m, k.transverse_m, k.meridian_slope_m, k.transverse_slope_m);
      lines.line("rate", earth_rate_n(at.latitude_rad));
      lines.line("ecef", ecef_from_geodetic(at));
      const GeodeticPosition there = displaced(at, {3000.0, -2000.0, 150.0});
      add_position(lines, "displaced", there);
      lines.line("offset", ned_offset(at, {at.latitude_rad + 1e-4, at.longitude_rad - 2e-4, height_m + 7.0}));
    }
  }
  test::expect_recorded("estimation/navigation/earth.txt", lines.text(), test::kShareOfNumber, 1e-18);
}

TEST(NavigationAnswers, OnEarthEndsAtThePolesTheDateLineTheDeepestSeaAndTheEdgeOfSpace) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(is_on_earth({0.5 * kPi, 2.0 * kPi, 100e3}));
  EXPECT_TRUE(is_on_earth({-0.5 * kPi, -2.0 * kPi, -11e3}));
  EXPECT_FALSE(is_on_earth({1.5708, 0.0, 0.0}));
  EXPECT_FALSE(is_on_earth({0.0, -6.2832, 0.0}));
  EXPECT_FALSE(is_on_earth({0.0, 0.0, -11'000.1}));
  EXPECT_FALSE(is_on_earth({0.0, 0.0, 100'000.1}));
  EXPECT_FALSE(is_on_earth({nan, 0.0, 0.0}));
  EXPECT_FALSE(is_on_earth({0.0, nan, 0.0}));
  EXPECT_FALSE(is_on_earth({0.0, 0.0, nan}));
}

TEST(NavigationAnswers, ErrorModel) {
  Answer lines;
  const NavigationProcessNoise noise{0.02, 0.3, {0.05, 40.0}, {0.7, 90.0}};
  NavigationProcessNoise constant = noise;
  constant.gyro_bias.correlation_time_s = std::numeric_limits<double>::infinity();
  for (const NavigationState& state : kPlaces) {
    lines.line("dynamics", error_dynamics(state, kRates));
    const NavigationTransition step = transition(state, kRates, noise, 0.1);
    lines.line("transition", step.kinematic_rows);
    lines.line("decay", step.gyro_bias_decay, step.accel_bias_decay);
    lines.line("noise", step.process_covariance);
  }
  const NavigationTransition step = transition(kPlaces[0], kRates, constant, 0.05);
  lines.line("constant bias", step.gyro_bias_decay, step.accel_bias_decay,
             step.process_covariance.diagonal());
  NavigationErrorVector error;
  error << 1.1, -2.2, 3.3, 0.4, -0.5, 0.6, 0.01, -0.02, 0.03, 1e-3, 2e-3, -3e-3, 0.1, -0.2, 0.3;
  NavigationState moved = kPlaces[2];
  inject(moved, error);
  add_state(lines, moved);
  lines.line("between", error_between(moved, kPlaces[2]));
  test::expect_recorded("estimation/navigation/error_model.txt", lines.text(), test::kShareOfNumber,
                        kNothing);
}

TEST(NavigationAnswers, Strapdown) {
  Answer lines;
  const InertialRates next{{0.25, -0.4, 0.6}, {-2.0, 1.5, -11.0}};
  for (const NavigationState& place : kPlaces) {
    for (const bool of_means : {false, true}) {
      const InertialIncrement step =
          of_means ? increment_from_means(kRates, next, 0.1) : increment_from_samples(kRates, next, 0.1);
      lines.line("increment", step.rotation_rad, step.delta_v_b_mps, step.dt_s);
      NavigationState state = place;
      for (int i = 0; i < 50; ++i) propagate(state, step);
      add_state(lines, state);
    }
  }
  // At the speed of an aircraft the turn of local NED and the radii of the interval's middle show, too.
  NavigationState fast = kPlaces[2];
  fast.v_n_mps = {-400.0, 600.0, 30.0};
  for (int i = 0; i < 200; ++i) propagate(fast, {{0.05, -0.08, 0.11}, {1.0, 2.0, -5.0}, 0.5});
  add_state(lines, fast);
  test::expect_recorded("estimation/navigation/strapdown.txt", lines.text(), 1e-8);
}

TEST(NavigationAnswers, Measurements) {
  Answer lines;
  const Vector3d arm(1.4, -0.8, -2.2);
  for (const NavigationState& state : kPlaces) {
    const GeodeticPosition antenna = displaced(state.position, {3.0, -4.0, 5.0});
    const GnssInnovation position = gnss_position_innovation(state, antenna, arm);
    lines.line("position", position.innovation, position.H);
    const GnssInnovation velocity =
        gnss_velocity_innovation(state, {20.0, -12.0, 2.0}, kRates.omega_ib_b_radps, arm);
    lines.line("velocity", velocity.innovation, velocity.H);
    lines.line("antenna in position", antenna_in_position(state, kRates, arm));
    lines.line("antenna in velocity", antenna_in_velocity(state, kRates, arm));
    const OdometryState vehicle{exp_so3({0.02, -0.05, 0.3}), {1.1, 0.3, 0.6}, 0.02};
    const OdometryInnovation wheels = odometry_innovation(state, vehicle, 17.0, kRates.omega_ib_b_radps);
    lines.line("wheels", wheels.innovation, wheels.predicted, wheels.H);
    lines.line("wheels' own", wheels.H_odometry);
    const ZeroVelocityInnovation still = zero_velocity_innovation(state);
    lines.line("standing", still.innovation, still.H);
  }
  AntennaState antenna{{1.0, 2.0, 3.0}, 0.01};
  inject(antenna, AntennaErrorVector(0.1, -0.2, 0.3, 0.004));
  lines.line("antenna", antenna.r_ba_b_m, antenna.latency_s);
  OdometryState odometry{exp_so3({0.1, 0.2, 0.3}), {1.0, 2.0, 3.0}, 0.01};
  OdometryErrorVector error;
  error << 0.003, 0.02, -0.03, 0.1, -0.2, 0.4;
  inject(odometry, error);
  lines.line("odometry", odometry.C_b_v, odometry.r_bv_b_m, odometry.scale);
  test::expect_recorded("estimation/navigation/measurements.txt", lines.text(), test::kShareOfNumber,
                        kNothing);
}

TEST(NavigationAnswers, GnssGate) {
  GnssGate gate({16.0, 4, 3.0});
  Answer lines;
  Matrix3d S = Vector3d(1.0, 2.0, 4.0).asDiagonal();
  S(0, 1) = S(1, 0) = 0.3;
  const Matrix3d R = 0.01 * Matrix3d::Identity();
  const auto ask = [&](double t, const Vector3d& innovation, const Matrix3d& covariance) {
    const GateDecision decision = gate.decide(instant(t), innovation, covariance, R);
    lines.line("decision", t, decision, gate.last_nis(), gate.streak(), gate.accepted(), gate.rejected(),
               gate.reacquisitions());
  };
  ask(0.0, {1.0, -1.0, 2.0}, S);
  ask(1.0, {0.0, 0.0, 8.0}, S);  // at the bound
  ask(2.0, {0.0, 0.0, 8.001}, S);
  ask(3.0, {9.0, 0.0, 0.0}, S);
  // The third differs from the second by less than its own scatter and a metre a second, the fourth by more.
  ask(4.0, {9.0, 3.9, 0.0}, S);
  ask(5.0, {9.0, 8.2, 0.0}, S);
  for (int i = 6; i < 12; ++i) ask(i, {9.0, 8.2, 0.0}, S);
  ask(12.0, {std::nan(""), 0.0, 0.0}, S);
  ask(13.0, {0.1, 0.0, 0.0}, Matrix3d::Zero());
  ask(14.0, {0.1, 0.0, 0.0}, S);
  // Enough of them, but not for long enough; then both.
  for (int i = 0; i < 8; ++i) ask(20.0 + 0.5 * i, {20.0, 0.0, 0.0}, S);
  test::expect_recorded("estimation/navigation/gnss_gate.txt", lines.text());
}

TEST(NavigationAnswers, SdBelowItsFloorOrNoNumberIsTheFloor) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  EXPECT_EQ(floored_sd({0.5, 0.01, nan}, {0.1, 0.02, 0.3}), Vector3d(0.5, 0.02, 0.3));
  EXPECT_EQ(floored_sd({-1.0, inf, 0.3}, {0.1, 0.02, 0.3}), Vector3d(0.1, 0.02, 0.3));
}

/// Windows of a vehicle that turns, felt in a frame 2.1 rad from north with an acceleration error and a drift.
std::vector<VelocityChange> windows_of(std::size_t n, double noise_mps) {
  test::RandomStates random(71);
  std::vector<VelocityChange> windows;
  for (std::size_t i = 0; i < n; ++i) {
    const auto at = static_cast<double>(i);
    VelocityChange w;
    w.age_s = 0.5 * static_cast<double>(n - i);
    w.half_span_s = 3.0 + 0.1 * std::sin(at);
    w.felt_a_mps = 3.0 * Vector2d(std::cos(0.7 * at), std::sin(0.43 * at));
    w.sd_mps = 0.02 + 0.001 * at;
    const Vector2d felt = w.felt_a_mps + w.half_span_s * Vector2d(0.05, -0.08);
    const std::complex<double> seen =
        std::polar(1.0, 2.1 - 1e-3 * w.age_s) * std::complex<double>(felt.x(), felt.y());
    w.seen_n_mps =
        Vector2d(seen.real(), seen.imag()) + noise_mps * Vector2d(random.normal(1.0), random.normal(1.0));
    windows.push_back(w);
  }
  return windows;
}

void add_heading(Answer& lines, std::string_view name, const std::vector<VelocityChange>& windows,
                 const HeadingPriors& priors) {
  HeadingSolution out;
  const bool found = solve_heading(windows, priors, out);
  lines.line(name, found, out.heading_rad, out.sd_rad, out.acceleration_error_a_mps2,
             out.acceleration_error_sd_mps2, out.scale, out.weight_share);
}

TEST(NavigationAnswers, HeadingSolver) {
  Answer lines;
  const HeadingPriors priors{2e-3, 0.1, 4.0};
  for (const std::size_t n : {7U, 8U, 9U, 40U, 256U, 300U}) {
    add_heading(lines, "plain", windows_of(n, 0.0), priors);
    add_heading(lines, "noisy", windows_of(n, 0.3), priors);
  }
  for (const HeadingPriors& other : {HeadingPriors{1e-7, 1e-3, 1.0}, HeadingPriors{1.0, 10.0, 2.0}})
    add_heading(lines, "other priors", windows_of(40, 0.3), other);
  std::vector<VelocityChange> outliers = windows_of(40, 0.1);
  for (std::size_t i = 0; i < outliers.size(); i += 5) outliers[i].seen_n_mps += Vector2d(8.0, -6.0);
  add_heading(lines, "outliers", outliers, priors);
  std::vector<VelocityChange> half_scale = windows_of(40, 0.1);
  for (VelocityChange& w : half_scale) w.felt_a_mps *= 2.0;
  add_heading(lines, "half as much seen", half_scale, priors);
  // Felt changes that are hardly any: mean square 0.0135 and 0.006 m^2/s^2 about what a constant explains.
  for (const double size : {0.05, 0.03}) {
    std::vector<VelocityChange> little = windows_of(40, 0.0);
    for (VelocityChange& w : little) w.felt_a_mps *= size;
    add_heading(lines, "little change", little, priors);
  }
  test::expect_recorded("estimation/navigation/heading_solver.txt", lines.text(), 1e-5, 1e-6);
}

/// A car that stands, then winds along a road: speed, yaw and attitude in closed form.
class Winding {
 public:
  Winding(double rest_s, double heading_rad) : rest_s_(rest_s), heading_rad_(heading_rad) {}

  void advance(double dt_s) {
    constexpr int kParts = 10;
    for (int i = 0; i < kParts; ++i) {
      const double h = dt_s / kParts;
      const Vector3d before = velocity();
      t_ += h;
      position_ += 0.5 * h * (before + velocity());
    }
  }
  [[nodiscard]] double t() const { return t_; }
  [[nodiscard]] const Vector3d& position() const { return position_; }
  [[nodiscard]] Matrix3d C_b_n() const {
    return rotation_from_euler({0.0, 0.0, heading()}) * rotation_from_euler({0.06, -0.09, 0.8});
  }
  [[nodiscard]] Vector3d velocity() const {
    return speed() * Vector3d(std::cos(heading()), std::sin(heading()), 0.0);
  }
  [[nodiscard]] InertialRates rates() const {
    const Vector3d forward(std::cos(heading()), std::sin(heading()), 0.0);
    const Vector3d right(-forward.y(), forward.x(), 0.0);
    const double yaw_rate = since() > 0.0 ? 0.25 * std::sin(0.4 * since()) : 0.0;
    const double acceleration = since() > 0.0 ? 1.5 * std::sin(0.25 * since()) : 0.0;
    const Vector3d gravity(0.0, 0.0, 9.806);
    const Matrix3d C_n_b = C_b_n().transpose();
    return {C_n_b * (Vector3d(0.0, 0.0, yaw_rate) + earth_rate_n(0.81)),
            C_n_b * (acceleration * forward + speed() * yaw_rate * right - gravity)};
  }

 private:
  [[nodiscard]] double since() const { return t_ - rest_s_; }
  [[nodiscard]] double speed() const { return since() > 0.0 ? 6.0 * (1.0 - std::cos(0.25 * since())) : 0.0; }
  [[nodiscard]] double heading() const {
    return heading_rad_ + (since() > 0.0 ? 0.25 / 0.4 * (1.0 - std::cos(0.4 * since())) : 0.0);
  }
  double rest_s_;
  double heading_rad_;
  double t_ = 0.0;
  Vector3d position_ = Vector3d::Zero();
};

const GeodeticPosition kTown{46.41 * kRadPerDeg, 6.57 * kRadPerDeg, 420.0};

/// What one run of the aligner is made of.
struct AlignerRun {
  double rest_s = 8.0;
  double end_s = 45.0;
  double gyro_bias_sd_radps = 0.2 * kRadPerDeg;
  double gyro_white_radps_per_sqrt_hz = 0.007 * kRadPerDeg;
  double averaged_rest_s = 6.0;
  double gnss_sd_m = 0.05;
  bool with_velocity = false;
  double attitude_from_s = 1e9;
  double silent_from_s = 1e9;  ///< no positions from here on
  double jump_from_s = 1e9;    ///< positions twenty metres off from here on
  double host_scale = 1.0;
  double period_s = 0.01;
  int gnss_every = 20;  ///< samples from one position to the next
  double latency_s = 0.08;
  int tell_every = 350;
};

void add_result(Answer& lines, const InitialAligner& aligner, double t) {
  lines.line("stage", t, aligner.stage(), aligner.heading_sd_rad());
  const InitialNavigation* const found = aligner.result();
  if (found == nullptr) return;
  lines.line("start", to_seconds(found->time - HostTime{}), found->method, found->sd.head<9>());
  add_state(lines, found->state);
  const AlignmentRest& rest = found->rest;
  lines.line("rest", rest.length_s, rest.age_s, 1e3 * rest.sway_radps, rest.mean.omega_ib_b_radps,
             rest.mean.f_b_mps2, rest.C_b_n);
}

void add_run(Answer& lines, std::string_view name, const AlignerRun& run) {
  lines.line(name);
  InitialAlignmentOptions options;
  options.reference_noise = {
      run.gyro_white_radps_per_sqrt_hz, 1e-3, {run.gyro_bias_sd_radps, 1000.0}, {0.05, 1000.0}};
  options.r_ba_b_m = {0.4, -0.2, -1.2};
  options.gyrocompass_s_max = run.averaged_rest_s;
  InitialAligner aligner(options);
  Winding car(run.rest_s, 1.2);
  for (int i = 0; car.t() < run.end_s; ++i) {
    const double t = car.t();
    InertialRates measured = car.rates();
    measured.omega_ib_b_radps +=
        Vector3d(1e-4, -2e-4, 1.5e-4) + 1e-3 * Vector3d(std::sin(9.1 * t), std::cos(7.7 * t), 0.3);
    measured.f_b_mps2 +=
        Vector3d(0.01, -0.02, 0.015) + 0.03 * Vector3d(std::cos(8.3 * t), 0.2, std::sin(6.9 * t));
    aligner.add_imu(instant(t), measured, run.host_scale);
    const Matrix3d C = car.C_b_n();
    const Vector3d scatter =
        run.gnss_sd_m * Vector3d(std::sin(31.0 * t), std::cos(17.0 * t), std::sin(23.0 * t));
    const Vector3d jump = t >= run.jump_from_s ? Vector3d(20.0, -12.0, 4.0) : Vector3d::Zero();
    if (i % run.gnss_every == run.gnss_every / 2 && t < run.silent_from_s)
      aligner.add_gnss_position(instant(t - run.latency_s),
                                displaced(kTown, car.position() - run.latency_s * car.velocity() +
                                                     C * options.r_ba_b_m + scatter + jump),
                                run.gnss_sd_m * Vector3d(1.0, 1.2, 2.0));
    if (run.with_velocity && i % (2 * run.gnss_every) == run.gnss_every)
      aligner.add_gnss_velocity(instant(t - run.latency_s), car.velocity() + 0.02 * scatter,
                                Vector3d(0.03, 0.04, 0.05));
    if (t >= run.attitude_from_s && i % 25 == 5)
      aligner.add_attitude(instant(t - 0.01), euler_from_rotation(C), Vector3d(1e-3, 2e-3, 5e-3));
    if (i % run.tell_every == run.tell_every - 1) add_result(lines, aligner, t);
    car.advance(run.period_s);
  }
}

TEST(NavigationAnswers, InitialAligner) {
  Answer lines;
  add_run(lines, "in motion", {});
  add_run(lines, "in motion, velocities, a host second that is long",
          {.with_velocity = true, .host_scale = 1.001});
  add_run(lines, "gyrocompass",
          {.rest_s = 26.0,
           .end_s = 34.0,
           .gyro_bias_sd_radps = 1e-7,
           .gyro_white_radps_per_sqrt_hz = 1e-6,
           .averaged_rest_s = 20.0,
           .gnss_sd_m = 0.5});
  add_run(lines, "own attitude",
          {.rest_s = 3.0, .end_s = 20.0, .with_velocity = true, .attitude_from_s = 10.0});
  add_run(lines, "positions end", {.end_s = 40.0, .silent_from_s = 33.0});
  add_run(lines, "positions jump", {.end_s = 40.0, .jump_from_s = 33.0});
  add_run(lines, "one metre", {.end_s = 60.0, .gnss_sd_m = 1.0});
  // Every instant is a binary fraction, so that times lie at their limits and not beside them.
  add_run(lines, "eight times a second",
          {.end_s = 36.0,
           .with_velocity = true,
           .silent_from_s = 30.0,
           .period_s = 0.125,
           .gnss_every = 4,
           .latency_s = 0.0,
           .tell_every = 7});
  test::expect_recorded("estimation/navigation/initial_alignment.txt", lines.text(), 1e-5, 1e-7);
}

/// An aligner that has found its level at rest, ten seconds in.
InitialAligner levelled() {
  InitialAligner aligner{InitialAlignmentOptions{}};
  for (int i = 0; i <= 80; ++i)
    aligner.add_imu(instant(0.125 * i), {Vector3d::Zero(), Vector3d(0.0, 0.0, -9.8)});
  return aligner;
}

TEST(NavigationAnswers, HalfASecondIsNoGapYetAndNotTooOld) {
  const InertialRates rest{Vector3d::Zero(), Vector3d(0.0, 0.0, -9.8)};
  InitialAligner aligner = levelled();
  EXPECT_EQ(aligner.stage(), AlignmentStage::kWaitingForHeading);
  aligner.add_imu(instant(10.5), rest);
  EXPECT_EQ(aligner.stage(), AlignmentStage::kWaitingForHeading);
  aligner.add_imu(instant(11.0) + Duration{1}, rest);
  EXPECT_EQ(aligner.stage(), AlignmentStage::kWaitingForRest);
  for (const Duration late : {Duration{0}, Duration{1}}) {
    InitialAligner with_attitude = levelled();
    with_attitude.add_attitude(instant(9.5) - late, {0.1, 0.2, 0.3}, Vector3d::Constant(1e-3));
    EXPECT_EQ(with_attitude.stage(),
              late == Duration{0} ? AlignmentStage::kWaitingForPosition : AlignmentStage::kWaitingForHeading);
  }
}

TEST(NavigationAnswers, LevelAndGyrocompass) {
  Answer lines;
  for (const Vector3d& f : {Vector3d(0.0, 0.0, -9.8), Vector3d(3.0, -4.0, -8.0), Vector3d(-9.0, 1.0, 3.0)}) {
    const InitialAttitude level = level_from_rest(f, 0.05, 1.3);
    lines.line("level", level.sd_n_rad, level.C_b_n);
    for (const double latitude_rad : {0.8, -1.2, 1.5707}) {
      const InitialAttitude found = gyrocompass({3e-5, -4e-5, -5e-5}, f, 2e-7, 0.02, latitude_rad);
      lines.line("gyrocompass", found.sd_n_rad, found.C_b_n);
    }
  }
  test::expect_recorded("estimation/navigation/level.txt", lines.text());
}

}  // namespace
}  // namespace imuscope
