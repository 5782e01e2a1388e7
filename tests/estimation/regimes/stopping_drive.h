#pragma once

/// A car in town for the tests of regimes, with a stop a minute. It is made of other pieces than
/// firmware_sim's drive: constant braking with a jolt or a soft end, a body that swings after the stop, a
/// rough road whose shaking grows with speed, an engine that idles at every light.

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <optional>
#include <random>
#include <vector>

#include "base/units.h"
#include "estimation/regimes/motion_levels.h"

namespace imuscope::test {

struct StoppingDrive {
  double duration_s = 900.0;
  double shortest_stop_s = 1.0;
  double longest_stop_s = 10.0;
  bool engine_runs = true;
  bool has_speed = true;
  double gyro_density_radps = 0.01 * kRadPerDeg;  ///< per sqrt(Hz), of the reference
  double accel_density_mps2 = 1e-3;               ///< per sqrt(Hz)
  std::uint64_t seed = 1;
};

struct Stop {
  double begin_s;
  double end_s;
};

/// What a reference of 100 Hz shows at one instant; the speed where it is told.
struct DrivenSample {
  HostTime time;
  Vector3 omega_radps;
  Vector3 f_mps2;
  std::optional<double> speed_mps;
};

inline constexpr double kDrivenSpeedSd_mps = 0.03;

/// What was driven: samples, their levels, and where the speed was zero.
struct Driven {
  std::vector<DrivenSample> samples;
  MotionLevels levels;
  std::vector<Stop> stops;
};

inline Driven driven(const StoppingDrive& drive) {
  constexpr double kRate_hz = 100.0;
  constexpr double kStep_s = 1.0 / kRate_hz;
  constexpr double kGravity_mps2 = 9.81;
  std::mt19937_64 random(drive.seed);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  std::normal_distribution<double> normal;
  const auto vector = [&] { return Eigen::Vector3d{normal(random), normal(random), normal(random)}; };

  // The acceleration along the road: stand, speed up, cruise, brake; the brake ends by a jolt or softly.
  std::vector<double> speed_mps;
  Driven out;
  const auto stand = [&](double s) {
    out.stops.push_back({kStep_s * static_cast<double>(speed_mps.size()), 0.0});
    for (double t = 0.0; t < s; t += kStep_s) speed_mps.push_back(0.0);
    out.stops.back().end_s = kStep_s * static_cast<double>(speed_mps.size());
  };
  stand(30.0);
  while (kStep_s * static_cast<double>(speed_mps.size()) < drive.duration_s - 90.0) {
    const double top_mps = uniform(4.0, 17.0);
    const double acceleration = uniform(0.8, 2.5);
    const double ramp_s = uniform(0.2, 1.0);
    double v = 0.0;
    for (double t = 0.0; v < top_mps; t += kStep_s) {
      v += kStep_s * acceleration * std::min(1.0, (t + kStep_s) / ramp_s);
      speed_mps.push_back(v);
    }
    const double cruise_s = uniform(20.0, 50.0);
    for (double t = 0.0; t < cruise_s; t += kStep_s)
      speed_mps.push_back(v * (1.0 + 0.05 * std::sin(0.6 * t)));
    v = speed_mps.back();
    const double braking = uniform(0.8, 3.0);
    // The last of the speed goes with a share of the braking: what a careful foot does.
    const double soft_mps = uniform(0.0, 0.5);
    const double soft_braking = uniform(0.4, 1.0) * braking;
    while (v > 0.0) {
      v -= kStep_s * (v > soft_mps ? braking : soft_braking);
      speed_mps.push_back(std::max(0.0, v));
    }
    stand(uniform(drive.shortest_stop_s, drive.longest_stop_s));
  }
  stand(30.0);

  const double idle_hz = uniform(20.0, 30.0);
  const double gyro_sd = drive.gyro_density_radps * std::sqrt(kRate_hz);
  const double accel_sd = drive.accel_density_mps2 * std::sqrt(kRate_hz);
  const Eigen::Vector3d f_line = 0.1 * vector();
  const Eigen::Vector3d omega_line = 5e-4 * vector();
  Eigen::Vector3d road_f = Eigen::Vector3d::Zero();
  Eigen::Vector3d road_omega = Eigen::Vector3d::Zero();
  double pitch_rad = 0.0;
  double pitch_radps = 0.0;
  double yaw_radps = 0.0;
  double yaw_wanted_radps = 0.0;
  double phase_rad = 0.0;
  double speed_error_mps = 0.0;
  for (std::size_t k = 0; k < speed_mps.size(); ++k) {
    const double t_s = kStep_s * static_cast<double>(k);
    const double v = speed_mps[k];
    const double a = k > 0 ? (v - speed_mps[k - 1]) / kStep_s : 0.0;
    // The body on its springs: 1.3 Hz, damped to a third; 0.25 deg for a brake of 1 m/s^2.
    constexpr double kSpring = 2.0 * std::numbers::pi * 1.3;
    pitch_radps +=
        kStep_s * (kSpring * kSpring * (0.0044 * a - pitch_rad) - 2.0 * 0.33 * kSpring * pitch_radps);
    pitch_rad += kStep_s * pitch_radps;
    if (k % 400 == 0) yaw_wanted_radps = uniform(0.0, 1.0) < 0.4 ? uniform(-0.4, 0.4) : 0.0;
    yaw_radps += kStep_s * (std::min(1.0, v / 3.0) * yaw_wanted_radps - yaw_radps) / 0.5;
    if (v == 0.0) yaw_radps = 0.0;
    const double rough = v / 10.0;
    road_f += 0.2 * (rough * 0.9 * vector() - road_f);
    road_omega += 0.2 * (rough * 0.03 * vector() - road_omega);
    const double engine_hz = v > 0.0 ? idle_hz + 1.2 * v : idle_hz;
    phase_rad += 2.0 * std::numbers::pi * kStep_s * engine_hz;
    const double engine = drive.engine_runs ? 1.0 + 0.1 * v : 0.0;
    const Eigen::Vector3d f = Eigen::Vector3d(a + kGravity_mps2 * pitch_rad, v * yaw_radps, -kGravity_mps2) +
                              road_f + engine * std::sin(phase_rad) * f_line + accel_sd * vector();
    const Eigen::Vector3d omega = Eigen::Vector3d(0.0, pitch_radps, yaw_radps) + road_omega +
                                  engine * std::cos(phase_rad) * omega_line + gyro_sd * vector();
    const HostTime time = HostTime{} + from_seconds(1000.0 + t_s);
    out.samples.push_back({time, {omega.x(), omega.y(), omega.z()}, {f.x(), f.y(), f.z()}, {}});
    DrivenSample& sample = out.samples.back();
    if (drive.has_speed && k % 10 == 0) {
      speed_error_mps += 0.2 * (0.06 * normal(random) - speed_error_mps);
      sample.speed_mps = v + speed_error_mps;
    }
    out.levels.add(time, sample.omega_radps, sample.f_mps2);
    if (sample.speed_mps) out.levels.add_speed(time, *sample.speed_mps, kDrivenSpeedSd_mps);
  }
  return out;
}

}  // namespace imuscope::test
