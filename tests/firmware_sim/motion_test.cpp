#include "firmware_sim/motion/motion.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <cmath>

#include "firmware_sim/motion/earth.h"
#include "firmware_sim/motion/quintic_spline.h"

namespace imusim {
namespace {

constexpr double kRadPerDeg = 3.14159265358979323846 / 180.0;

// Middles between two of the splines' 20 Hz nodes: no difference reaches over a node, where the fifth
// derivative jumps and differences lose their order.
constexpr double kFirst_s = 55.325;
constexpr double kStride_s = 7.35;

const Motion& drive() {
  static const Motion motion{Scenario{}};
  return motion;
}

/// Fourth-order central difference of a function of time.
template <typename Function>
auto difference(const Function& function, double t_s, double step_s) -> decltype(function(t_s)) {
  return ((function(t_s + step_s) - function(t_s - step_s)) * (8.0 / 12.0) -
          (function(t_s + 2 * step_s) - function(t_s - 2 * step_s)) * (1.0 / 12.0)) /
         step_s;
}

Eigen::Vector3d ecef_at(double t_s) { return ecef_from_geodetic(drive().state_at(t_s).position); }

Eigen::Vector3d rotation_vector(const Eigen::Matrix3d& C) {
  const Eigen::AngleAxisd angle_axis(C);
  return angle_axis.angle() * angle_axis.axis();
}

TEST(QuinticSpline, GoesThroughItsValuesAndItsFourthDerivativeDoesNotJump) {
  const std::vector<double> values = {0.0, 0.0, 1.0, -2.0, 0.5, 3.0, 3.0, 3.0};
  constexpr double kStep_s = 0.5;
  const QuinticSpline spline(kStep_s, values);
  for (std::size_t i = 0; i < values.size(); ++i)
    EXPECT_NEAR(spline.at(kStep_s * static_cast<double>(i)).value, values[i], 1e-12);
  // Third and fourth derivatives on each side of a node, from the second derivative's one-sided differences:
  // it is cubic between nodes, so four points give them exactly.
  const auto one_sided = [&](double t_s, double h) {
    const auto s = [&](double k) { return spline.at(t_s + k * h).second; };
    const double third = (-11.0 * s(0) + 18.0 * s(1) - 9.0 * s(2) + 2.0 * s(3)) / (6.0 * h);
    const double fourth = (2.0 * s(0) - 5.0 * s(1) + 4.0 * s(2) - s(3)) / (h * h);
    return std::pair{third, fourth};
  };
  for (double t_s = kStep_s; t_s < 3.4; t_s += kStep_s) {
    const auto [third_after, fourth_after] = one_sided(t_s + 1e-13, 0.05);
    const auto [third_before, fourth_before] = one_sided(t_s - 1e-13, -0.05);
    EXPECT_NEAR(third_after, third_before, 1e-6);
    EXPECT_NEAR(fourth_after, fourth_before, 1e-4);
  }
}

TEST(Earth, NormalGravityHasItsPublishedValuesAtEquatorAndPole) {
  EXPECT_NEAR(normal_gravity_mps2(0.0, 0.0), 9.7803253359, 1e-10);  // TR8350.2 table 3.4
  EXPECT_NEAR(normal_gravity_mps2(90.0 * kRadPerDeg, 0.0), 9.8321849378, 1e-9);
  // Free-air gradient at 45 degrees: -3.086e-6 per metre.
  const double gradient =
      (normal_gravity_mps2(45 * kRadPerDeg, 1000.0) - normal_gravity_mps2(45 * kRadPerDeg, 0.0)) / 1000.0;
  EXPECT_NEAR(gradient, -3.085e-6, 3e-9);
}

TEST(Earth, ADisplacedPlaceLiesWhereTheTangentPlaneSays) {
  const GeodeticPosition place{46.52 * kRadPerDeg, 6.57 * kRadPerDeg, 420.0};
  for (const Eigen::Vector3d& step :
       {Eigen::Vector3d(3.0, -2.0, 1.5), Eigen::Vector3d(-20.0, 15.0, -1.0), Eigen::Vector3d(0, 0, 5.0)}) {
    const Eigen::Vector3d expected = ecef_from_geodetic(place) + C_n_e_at(place) * step;
    EXPECT_LT((ecef_from_geodetic(displaced(place, step)) - expected).norm(), 1e-6);
  }
}

TEST(Motion, VelocityIsTheDerivativeOfPosition) {
  for (double t_s = kFirst_s; t_s < 900.0; t_s += kStride_s) {
    const MotionState state = drive().state_at(t_s);
    const Eigen::Vector3d v_e = difference(ecef_at, t_s, 0.008);
    EXPECT_LT((C_n_e_at(state.position) * state.v_n_mps - v_e).norm(), 3e-6) << "at " << t_s << " s";
  }
}

TEST(Motion, RateIsTheDerivativeOfAttitudeInInertialSpace) {
  const auto C_b_i = [](double t_s) -> Eigen::Matrix3d {
    const MotionState state = drive().state_at(t_s);
    const Eigen::AngleAxisd earth(kEarthRate_radps * t_s, Eigen::Vector3d::UnitZ());
    return earth.toRotationMatrix() * C_n_e_at(state.position) * state.C_b_n;
  };
  constexpr double kStep_s = 0.002;
  for (double t_s = kFirst_s; t_s < 900.0; t_s += kStride_s) {
    const Eigen::Matrix3d C = C_b_i(t_s);
    const auto angle = [&](double t) { return rotation_vector(C.transpose() * C_b_i(t)); };
    EXPECT_LT((difference(angle, t_s, kStep_s) - drive().state_at(t_s).omega_ib_b_radps).norm(), 1e-9)
        << "at " << t_s << " s";
  }
}

TEST(Motion, AngularAccelerationIsTheDerivativeOfRate) {
  const auto rate = [](double t_s) { return drive().state_at(t_s).omega_ib_b_radps; };
  for (double t_s = kFirst_s; t_s < 900.0; t_s += kStride_s)
    EXPECT_LT((difference(rate, t_s, 0.004) - drive().state_at(t_s).omega_dot_ib_b_radps2).norm(), 3e-8);
}

TEST(Motion, SpecificForceIsInertialAccelerationMinusGravitation) {
  // In inertial axes: a = d2/dt2 (C_e_i r_e), gravitation = normal gravity + centrifugal acceleration
  // removed.
  const auto C_e_i = [](double t_s) {
    return Eigen::AngleAxisd(kEarthRate_radps * t_s, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  };
  const auto v_i = [&](double t_s) -> Eigen::Vector3d {
    const MotionState state = drive().state_at(t_s);
    const Eigen::Vector3d omega_ie(0, 0, kEarthRate_radps);
    return C_e_i(t_s) *
           (C_n_e_at(state.position) * state.v_n_mps + omega_ie.cross(ecef_from_geodetic(state.position)));
  };
  for (double t_s = kFirst_s; t_s < 900.0; t_s += kStride_s) {
    const MotionState state = drive().state_at(t_s);
    const Eigen::Vector3d r_e = ecef_from_geodetic(state.position);
    const Eigen::Matrix3d C_n_e = C_n_e_at(state.position);
    const Eigen::Vector3d centrifugal =
        kEarthRate_radps * kEarthRate_radps * Eigen::Vector3d(r_e.x(), r_e.y(), 0.0);
    const Eigen::Vector3d gravitation_e =
        C_n_e *
            Eigen::Vector3d(0, 0, normal_gravity_mps2(state.position.latitude_rad, state.position.height_m)) -
        centrifugal;
    const Eigen::Vector3d f_e = C_e_i(t_s).transpose() * difference(v_i, t_s, 0.006) - gravitation_e;
    EXPECT_LT((state.C_b_n.transpose() * C_n_e.transpose() * f_e - state.f_b_mps2).norm(), 2e-7);
  }
}

TEST(Motion, IntegratingRateAndForceInAnEarthFixedMechanisationReturnsTheTrajectory) {
  // Own mechanisation in Earth-fixed axes, fourth-order Runge-Kutta on (r, v, C), 100 s of driving.
  struct State {
    Eigen::Vector3d r;
    Eigen::Vector3d v;
    Eigen::Quaterniond q;
  };
  constexpr double kBegin_s = 100.0;
  constexpr double kEnd_s = 200.0;
  constexpr double kStep_s = 0.01;
  const Eigen::Vector3d omega_ie(0, 0, kEarthRate_radps);
  const auto slope = [&](const State& s, const MotionState& truth) {
    const double latitude = truth.position.latitude_rad;
    const Eigen::Vector3d gravity_e =
        C_n_e_at(truth.position) *
        Eigen::Vector3d(0, 0, normal_gravity_mps2(latitude, truth.position.height_m));
    State d;
    d.r = s.v;
    d.v = s.q.normalized() * truth.f_b_mps2 + gravity_e - 2.0 * omega_ie.cross(s.v);
    const Eigen::Quaterniond rate_b(0, truth.omega_ib_b_radps.x(), truth.omega_ib_b_radps.y(),
                                    truth.omega_ib_b_radps.z());
    const Eigen::Quaterniond rate_e(0, 0, 0, kEarthRate_radps);
    d.q.coeffs() = 0.5 * ((s.q * rate_b).coeffs() - (rate_e * s.q).coeffs());
    return d;
  };
  const auto step = [](const State& s, const State& d, double h) {
    State next{s.r + h * d.r, s.v + h * d.v, s.q};
    next.q.coeffs() += h * d.q.coeffs();
    return next;
  };
  const MotionState begin = drive().state_at(kBegin_s);
  State s{ecef_from_geodetic(begin.position), C_n_e_at(begin.position) * begin.v_n_mps,
          Eigen::Quaterniond(Eigen::Matrix3d(C_n_e_at(begin.position) * begin.C_b_n))};
  const int steps = static_cast<int>(std::lround((kEnd_s - kBegin_s) / kStep_s));
  for (int i = 0; i < steps; ++i) {
    const double t_s = kBegin_s + i * kStep_s;
    const MotionState first = drive().state_at(t_s);
    const MotionState middle = drive().state_at(t_s + 0.5 * kStep_s);
    const MotionState last = drive().state_at(t_s + kStep_s);
    const State k1 = slope(s, first);
    const State k2 = slope(step(s, k1, 0.5 * kStep_s), middle);
    const State k3 = slope(step(s, k2, 0.5 * kStep_s), middle);
    const State k4 = slope(step(s, k3, kStep_s), last);
    s.r += kStep_s / 6.0 * (k1.r + 2 * k2.r + 2 * k3.r + k4.r);
    s.v += kStep_s / 6.0 * (k1.v + 2 * k2.v + 2 * k3.v + k4.v);
    s.q.coeffs() += kStep_s / 6.0 * (k1.q.coeffs() + 2 * k2.q.coeffs() + 2 * k3.q.coeffs() + k4.q.coeffs());
    s.q.normalize();
  }
  const MotionState end = drive().state_at(kEnd_s);
  EXPECT_LT((s.r - ecef_from_geodetic(end.position)).norm(), 1e-4);
  EXPECT_LT((s.v - C_n_e_at(end.position) * end.v_n_mps).norm(), 1e-5);
  EXPECT_LT(s.q.angularDistance(Eigen::Quaterniond(Eigen::Matrix3d(C_n_e_at(end.position) * end.C_b_n))),
            1e-8);
}

TEST(Motion, ForceAndVelocityAtALeverArmAgreeWithThatPointsOwnPath) {
  const Eigen::Vector3d r_b_m(0.35, -0.22, 0.12);
  const auto point_e = [&](double t_s) {
    return ecef_from_geodetic(position_at(drive().state_at(t_s), r_b_m));
  };
  for (double t_s = kFirst_s; t_s < 800.0; t_s += kStride_s) {
    const MotionState state = drive().state_at(t_s);
    const Eigen::Vector3d v_n = C_n_e_at(state.position).transpose() * difference(point_e, t_s, 0.008);
    EXPECT_LT((velocity_at(state, r_b_m) - v_n).norm(), 5e-6);
    // The force differs from that at b by the derivative of the velocity difference, in inertial axes.
    const auto swing_n = [&](double t) -> Eigen::Vector3d {
      const MotionState there = drive().state_at(t);
      return there.C_b_n * there.omega_ib_b_radps.cross(r_b_m);
    };
    const Eigen::Vector3d omega_in_n = state.C_b_n * (state.omega_ib_b_radps - state.omega_nb_b_radps);
    const Eigen::Vector3d expected_n = difference(swing_n, t_s, 0.006) + omega_in_n.cross(swing_n(t_s));
    const Eigen::Vector3d extra_b = specific_force_at(state, r_b_m) - state.f_b_mps2;
    EXPECT_LT((state.C_b_n * extra_b - expected_n).norm(), 1e-7);
  }
}

TEST(Motion, AtRestItFeelsMinusGravityAndTurnsWithTheEarth) {
  const MotionState state = drive().state_at(30.0);
  const double gravity = normal_gravity_mps2(state.position.latitude_rad, state.position.height_m);
  EXPECT_NEAR(state.f_b_mps2.norm(), gravity, 1e-12);
  EXPECT_LT(state.f_b_mps2.z(), -9.7);
  EXPECT_NEAR(state.omega_ib_b_radps.norm(), kEarthRate_radps, 1e-15);
  EXPECT_EQ(state.v_n_mps.norm(), 0.0);
}

TEST(Motion, TheDefaultDriveIsTheOneOfTheStudy) {
  // Statistics of the study's drive (its own seed) within what another seed changes.
  Eigen::Vector3d omega2 = Eigen::Vector3d::Zero();
  Eigen::Vector3d omega_dot2 = Eigen::Vector3d::Zero();
  Eigen::Vector3d f_sum = Eigen::Vector3d::Zero();
  Eigen::Vector3d f2 = Eigen::Vector3d::Zero();
  Eigen::Vector3d f_before = drive().state_at(-0.01).f_b_mps2;
  double jerk2 = 0.0;
  Eigen::Vector3d omega_max = Eigen::Vector3d::Zero();
  double distance_m = 0.0;
  double moving = 0.0;
  double speed_max = 0.0;
  constexpr int kSamples = 90000;
  for (int k = 0; k < kSamples; ++k) {
    const MotionState state = drive().state_at(0.01 * k);
    const double speed = state.v_n_mps.norm();
    omega2 += state.omega_ib_b_radps.cwiseAbs2();
    omega_max = omega_max.cwiseMax(state.omega_ib_b_radps.cwiseAbs());
    omega_dot2 += state.omega_dot_ib_b_radps2.cwiseAbs2();
    f_sum += state.f_b_mps2;
    f2 += state.f_b_mps2.cwiseAbs2();
    jerk2 += ((state.f_b_mps2 - f_before) / 0.01).squaredNorm();
    f_before = state.f_b_mps2;
    distance_m += 0.01 * speed;
    speed_max = std::max(speed_max, speed);
    moving += speed > 0.01 ? 1.0 : 0.0;
  }
  const Eigen::Vector3d omega_rms = (omega2 / kSamples).cwiseSqrt() / kRadPerDeg;
  const Eigen::Vector3d omega_dot_rms = (omega_dot2 / kSamples).cwiseSqrt() / kRadPerDeg;
  const Eigen::Vector3d f_rms = (f2 / kSamples - (f_sum / kSamples).cwiseAbs2()).cwiseSqrt();
  const auto within = [](double value, double study, double share) {
    return std::abs(value / study - 1.0) < share;
  };
  const Eigen::Vector3d study_omega(1.29, 1.04, 4.44);
  const Eigen::Vector3d study_omega_dot(11.1, 8.9, 3.4);
  const Eigen::Vector3d study_f(1.00, 0.70, 0.38);
  for (int i = 0; i < 3; ++i) {
    EXPECT_PRED3(within, omega_rms[i], study_omega[i], 0.3) << "axis " << i;
    EXPECT_PRED3(within, omega_dot_rms[i], study_omega_dot[i], 0.3) << "axis " << i;
    EXPECT_PRED3(within, f_rms[i], study_f[i], 0.3) << "axis " << i;
  }
  EXPECT_PRED3(within, f_rms.z(), study_f.z(), 0.1);
  // The study's time offset is known to 22 us from 90000 samples of 0.03 m/s^2 of white noise each:
  // its jerk is 0.03 / sqrt(90000) / 22e-6.
  EXPECT_PRED3(within, std::sqrt(jerk2 / kSamples), 0.03 / 300.0 / 22e-6, 0.15);
  EXPECT_PRED3(within, distance_m, 7400.0, 0.3);
  EXPECT_PRED3(within, moving / kSamples, 0.73, 0.15);
  EXPECT_PRED3(within, speed_max, 18.1, 0.15);
}

TEST(Motion, StandsStillAtBothEndsAndKnowsItsRegimes) {
  EXPECT_EQ(drive().regime_at(30.0), Regime::kStatic);
  EXPECT_EQ(drive().regime_at(300.0), Regime::kDynamic);
  EXPECT_EQ(drive().regime_at(899.0), Regime::kStatic);
  // A spline's foot before a start dies away by 0.43 a node.
  EXPECT_LT(drive().state_at(59.0).v_n_mps.norm(), 1e-12);
  EXPECT_LT(drive().state_at(900.0).v_n_mps.norm(), 1e-12);
  bool stops_on_the_way = false;
  for (double t_s = 100.0; t_s < 700.0; t_s += 0.5) {
    if (drive().regime_at(t_s) != Regime::kStatic) continue;
    stops_on_the_way = true;
    EXPECT_LT(drive().state_at(t_s).v_n_mps.norm(), 0.02) << t_s;
  }
  EXPECT_TRUE(stops_on_the_way);
}

TEST(Motion, AShortDriveStillMovesAfterTenSeconds) {
  Scenario scenario;
  scenario.duration_s = 60.0;
  const Motion motion(scenario);
  EXPECT_LT(motion.state_at(9.0).v_n_mps.norm(), 1e-12);
  EXPECT_GT(motion.state_at(30.0).v_n_mps.norm(), 3.0);
  EXPECT_LT(motion.state_at(59.9).v_n_mps.norm(), 1e-12);
}

/// Mean squares over the drive.
struct Shaking {
  double fast =
      0.0;  ///< of what differs from its neighbours 1/60 s away: all of 15 Hz, of 1 Hz 0.005 of the amplitude
  double whole = 0.0;  ///< of the value itself
};
Shaking shaking_of(const Motion& motion, double (*value)(const MotionState&)) {
  constexpr double kQuarter_s = 1.0 / 60.0;
  constexpr int kPoints = 20000;
  Shaking shaking;
  for (int k = 0; k < kPoints; ++k) {
    const double t_s = 100.0 + 0.03 * k;
    const double middle = value(motion.state_at(t_s));
    const double second =
        middle - 0.5 * (value(motion.state_at(t_s - kQuarter_s)) + value(motion.state_at(t_s + kQuarter_s)));
    shaking.fast += second * second / kPoints;
    shaking.whole += middle * middle / kPoints;
  }
  return shaking;
}

TEST(Motion, OnARoughRoadTheBodyShakesUpToFifteenHertz) {
  Scenario scenario;
  const Motion smooth(scenario);
  scenario.rough_road_to_hz = kWheelHop_hz;
  const Motion rough(scenario);
  const auto roll = [](const MotionState& state) { return state.omega_ib_b_radps.x(); };
  const auto pitch = [](const MotionState& state) { return state.omega_ib_b_radps.y(); };
  const auto heave = [](const MotionState& state) { return state.f_b_mps2.z() + 9.81; };
  double speed2 = 0.0;
  for (int k = 0; k < 20000; ++k)
    speed2 += std::pow(smooth.state_at(100.0 + 0.03 * k).v_n_mps.norm() / 10.0, 2) / 20000;
  const auto sd_per_speed = [&](double (*of)(const MotionState&)) {
    return std::sqrt((shaking_of(rough, of).whole - shaking_of(smooth, of).whole) / speed2);
  };
  // Where in its part of the band the slowest of the waves lies changes all by some per cent.
  EXPECT_NEAR(sd_per_speed(roll) / kRadPerDeg, 3.0, 0.4);
  EXPECT_NEAR(sd_per_speed(pitch) / kRadPerDeg, 3.0, 0.4);
  EXPECT_NEAR(sd_per_speed(heave), 0.5, 0.07);
  // From 1.5 to 15 Hz with the same power: the mean of (1 - cos(2 pi f / 60 Hz))^2 over the band is 0.252.
  for (const auto of : {+roll, +pitch}) {
    const double whole = shaking_of(rough, of).whole - shaking_of(smooth, of).whole;
    EXPECT_NEAR((shaking_of(rough, of).fast - shaking_of(smooth, of).fast) / whole, 0.252, 0.02);
  }
  EXPECT_LT(shaking_of(smooth, roll).fast, 0.01 * shaking_of(rough, roll).fast);
  EXPECT_EQ(rough.state_at(30.0).f_b_mps2, smooth.state_at(30.0).f_b_mps2) << "no road where it stands";
}

TEST(Motion, SameSeedSameMotionAndAnotherSeedAnother) {
  Scenario scenario;
  scenario.duration_s = 200.0;
  const Motion first(scenario);
  const Motion second(scenario);
  scenario.seed = 2;
  const Motion third(scenario);
  EXPECT_EQ(first.state_at(100.0).f_b_mps2, second.state_at(100.0).f_b_mps2);
  EXPECT_NE(first.state_at(100.0).f_b_mps2, third.state_at(100.0).f_b_mps2);
}

}  // namespace
}  // namespace imusim
