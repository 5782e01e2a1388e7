#include "estimation/navigation/strapdown.h"
#include "estimation/navigation/local_earth.h"

#include <gtest/gtest.h>
#include <cmath>

#include "base/units.h"
#include "estimation/navigation/gravity.h"
#include "estimation/navigation/so3.h"

namespace imuscope {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

NavigationState lausanne() {
  NavigationState state;
  state.position = {46.52 * kRadPerDeg, 6.57 * kRadPerDeg, 420.0};
  state.C_b_n = rotation_from_euler({0.02, -0.03, 1.2});
  return state;
}

TEST(Strapdown, StaysWhereItIsWhenItFeelsOnlyEarthRateAndGravity) {
  NavigationState state = lausanne();
  const NavigationState start = state;
  const InertialRates at_rest{
      start.C_b_n.transpose() * earth_rate_n(start.position.latitude_rad),
      start.C_b_n.transpose() *
          Vector3d(0.0, 0.0, -normal_gravity(start.position.latitude_rad, start.position.height_m).g_mps2)};
  for (int i = 0; i < 60000; ++i) propagate(state, increment_from_samples(at_rest, at_rest, 0.01));
  EXPECT_LT(ned_offset(start.position, state.position).norm(), 1e-4);
  EXPECT_LT(log_so3(state.C_b_n * start.C_b_n.transpose()).norm(), 1e-9);
}

TEST(Strapdown, ConingMotionKeepsItsMeanAttitude) {
  // Classical coning about x: w = a W [-2 sin(a)/a.. ] is avoided by building the rate from the quaternion's
  // closed form: phi(t) = a (0, cos Wt, sin Wt), C = Exp(phi). Mean rotation about x is zero by construction.
  constexpr double kAngle_rad = 0.02;
  constexpr double kFrequency_radps = 2.0 * kPi * 5.0;
  constexpr double kDt_s = 0.01;
  constexpr int kSteps = 2000;
  const auto attitude = [&](double t) {
    return exp_so3(kAngle_rad *
                   Vector3d(0.0, std::cos(kFrequency_radps * t), std::sin(kFrequency_radps * t)));
  };
  const auto mean_rate = [&](double t0, double t1) {  // integral of w over the interval, Simpson on 20 panels
    constexpr int kPanels = 20;
    constexpr double kStep_s = 1e-5;
    Vector3d sum = Vector3d::Zero();
    for (int i = 0; i <= kPanels; ++i) {
      const double t = t0 + (t1 - t0) * i / kPanels;
      const Vector3d w = log_so3(attitude(t - kStep_s).transpose() * attitude(t + kStep_s)) / (2.0 * kStep_s);
      sum += w * (i == 0 || i == kPanels ? 1.0 : (i % 2 == 1 ? 4.0 : 2.0));
    }
    return Vector3d(sum / (3.0 * kPanels));
  };
  Matrix3d with = attitude(0.0);
  Matrix3d without = attitude(0.0);
  Vector3d previous = mean_rate(-kDt_s, 0.0);
  for (int i = 0; i < kSteps; ++i) {
    const Vector3d mean = mean_rate(kDt_s * i, kDt_s * (i + 1));
    const InertialIncrement inc =
        increment_from_means({previous, Vector3d::Zero()}, {mean, Vector3d::Zero()}, kDt_s);
    with = with * exp_so3(inc.rotation_rad);
    without = without * exp_so3(mean * kDt_s);
    previous = mean;
  }
  const Matrix3d truth = attitude(kDt_s * kSteps);
  const double error_with = log_so3(truth.transpose() * with).norm();
  const double error_without = log_so3(truth.transpose() * without).norm();
  // Uncorrected coning: a^2 W/2 (1 - sin(W dt)/(W dt)) = 1.03e-4 rad/s, over 20 s.
  const double expected = 0.5 * kAngle_rad * kAngle_rad * kFrequency_radps *
                          (1.0 - std::sin(kFrequency_radps * kDt_s) / (kFrequency_radps * kDt_s)) * kDt_s *
                          kSteps;
  EXPECT_NEAR(error_without, expected, 0.02 * expected);
  EXPECT_LT(error_with, 0.02 * error_without);
}

/// A lively motion with closed-form rates.
InertialRates lively(double t) {
  return {Vector3d(0.2 * std::sin(7.0 * t), 0.15 * std::cos(6.0 * t), 0.4 * std::sin(0.9 * t)),
          Vector3d(1.5 * std::sin(1.1 * t), 2.0 * std::cos(6.5 * t), -9.8 + 0.8 * std::sin(7.5 * t))};
}

/// Fine reference: the continuous equations by the classical Runge-Kutta method, attitude as a matrix.
struct Continuous {
  double L, lambda, h;
  Vector3d v;
  Matrix3d C;
};
Continuous derivative(const Continuous& s, double t) {
  const InertialRates r = lively(t);
  const Curvature k = curvature_at(s.L);
  const Vector3d w_ie = earth_rate_n(s.L);
  const Vector3d w_en = LocalEarth({s.L, s.lambda, s.h}).transport_rate(s.v);
  return {s.v.x() / (k.meridian_m + s.h), s.v.y() / ((k.transverse_m + s.h) * std::cos(s.L)), -s.v.z(),
          s.C * r.f_b_mps2 + Vector3d(0, 0, normal_gravity(s.L, s.h).g_mps2) - (2.0 * w_ie + w_en).cross(s.v),
          s.C * skew(r.omega_ib_b_radps) - skew(w_ie + w_en) * s.C};
}
Continuous moved(const Continuous& s, const Continuous& d, double dt) {
  return {s.L + dt * d.L, s.lambda + dt * d.lambda, s.h + dt * d.h, s.v + dt * d.v, s.C + dt * d.C};
}
NavigationState runge_kutta(const NavigationState& start, double duration_s) {
  constexpr double kStep_s = 5e-4;
  Continuous s{start.position.latitude_rad, start.position.longitude_rad, start.position.height_m,
               start.v_n_mps, start.C_b_n};
  const int steps = static_cast<int>(std::lround(duration_s / kStep_s));
  for (int i = 0; i < steps; ++i) {
    const double t = i * kStep_s;
    const Continuous k1 = derivative(s, t);
    const Continuous k2 = derivative(moved(s, k1, kStep_s / 2), t + kStep_s / 2);
    const Continuous k3 = derivative(moved(s, k2, kStep_s / 2), t + kStep_s / 2);
    const Continuous k4 = derivative(moved(s, k3, kStep_s), t + kStep_s);
    s = moved(moved(moved(moved(s, k1, kStep_s / 6), k2, kStep_s / 3), k3, kStep_s / 3), k4, kStep_s / 6);
  }
  NavigationState out = start;
  out.position = {s.L, s.lambda, s.h};
  out.v_n_mps = s.v;
  out.C_b_n = s.C;
  return out;
}

struct EndError {
  double position_m, velocity_mps, attitude_rad;
};
EndError end_error(const NavigationState& state, const NavigationState& truth) {
  return {ned_offset(truth.position, state.position).norm(), (state.v_n_mps - truth.v_n_mps).norm(),
          log_so3(state.C_b_n * truth.C_b_n.transpose()).norm()};
}

/// Mean of the closed-form rates over an interval, by Simpson's rule on fine panels.
InertialRates lively_mean(double t0, double dt) {
  constexpr int kPanels = 20;
  InertialRates mean;
  for (int i = 0; i <= kPanels; ++i) {
    const InertialRates r = lively(t0 + dt * i / kPanels);
    const double weight = (i == 0 || i == kPanels ? 1.0 : (i % 2 == 1 ? 4.0 : 2.0)) / (3.0 * kPanels);
    mean.omega_ib_b_radps += weight * r.omega_ib_b_radps;
    mean.f_b_mps2 += weight * r.f_b_mps2;
  }
  return mean;
}

NavigationState mechanised_from_samples(NavigationState state, double duration_s, double dt_s) {
  const int steps = static_cast<int>(std::lround(duration_s / dt_s));
  for (int i = 0; i < steps; ++i) {
    propagate(state, increment_from_samples(lively(i * dt_s), lively((i + 1) * dt_s), dt_s));
  }
  return state;
}

NavigationState mechanised_from_means(NavigationState state, double duration_s, double dt_s) {
  const int steps = static_cast<int>(std::lround(duration_s / dt_s));
  InertialRates previous = lively_mean(-dt_s, dt_s);
  for (int i = 0; i < steps; ++i) {
    const InertialRates mean = lively_mean(i * dt_s, dt_s);
    propagate(state, increment_from_means(previous, mean, dt_s));
    previous = mean;
  }
  return state;
}

TEST(Strapdown, FromMeansConvergesWithTheThirdPowerOfTheInterval) {
  NavigationState start = lausanne();
  start.v_n_mps = Vector3d(12.0, -8.0, 0.5);
  const NavigationState truth = runge_kutta(start, 20.0);
  const EndError coarse = end_error(mechanised_from_means(start, 20.0, 0.01), truth);
  const EndError fine = end_error(mechanised_from_means(start, 20.0, 0.005), truth);
  // Two-sample coning and sculling leave terms of w'' f dt^3: 1e-5 m/s^2 on a 7.5 rad/s motion.
  EXPECT_LT(coarse.attitude_rad, 2e-7);
  EXPECT_LT(coarse.velocity_mps, 2e-4);
  EXPECT_LT(coarse.position_m, 2e-3);
  EXPECT_GT(coarse.attitude_rad / fine.attitude_rad, 7.0);
  EXPECT_GT(coarse.velocity_mps / fine.velocity_mps, 7.0);
}

TEST(Strapdown, FromSamplesConvergesWithTheSquareOfTheInterval) {
  NavigationState start = lausanne();
  start.v_n_mps = Vector3d(12.0, -8.0, 0.5);
  const NavigationState truth = runge_kutta(start, 20.0);
  const EndError coarse = end_error(mechanised_from_samples(start, 20.0, 0.01), truth);
  const EndError fine = end_error(mechanised_from_samples(start, 20.0, 0.005), truth);
  // The trapezoid loses (w dt)^2/12 = 5e-4 of a 7.5 rad/s motion, which is centimetres here and none at rest.
  EXPECT_LT(coarse.position_m, 0.05);
  EXPECT_NEAR(coarse.attitude_rad / fine.attitude_rad, 4.0, 0.2);
  EXPECT_NEAR(coarse.velocity_mps / fine.velocity_mps, 4.0, 0.2);
  EXPECT_NEAR(coarse.position_m / fine.position_m, 4.0, 0.2);
}

TEST(Strapdown, KeepsTheAttitudeOrthonormalOverAMillionSteps) {
  NavigationState state = lausanne();
  for (int i = 0; i < 1000000; ++i) {
    const InertialRates r{Vector3d(0.3, -0.2, 0.5), Vector3d(0.0, 0.0, -9.8)};
    propagate(state, increment_from_samples(r, r, 1e-3));
  }
  EXPECT_LT((state.C_b_n.transpose() * state.C_b_n - Matrix3d::Identity()).norm(), 1e-14);
}

}  // namespace
}  // namespace imuscope
