#include "firmware_sim/motion/engine.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "firmware_sim/motion/draw.h"

namespace imusim {
namespace {

constexpr double kStep_s = 0.5;
constexpr double kIdle_hz = 24.0;  // 720 rpm of a four-stroke engine with four cylinders
constexpr double kLowest_hz = 22.0;
constexpr double kHighest_hz = 46.0;
// In motion: from the lowest engine speed of a gear to its highest, and the road speed that one gear spans.
constexpr double kGearFrom_hz = 28.0;
constexpr double kGearSpan_hz = 14.0;
constexpr double kGear_mps = 7.0;
constexpr double kStands_mps = 0.3;
// How the engine's speed wanders by itself.
constexpr double kWanderSd_hz = 0.4;
constexpr double kWanderTau_s = 3.0;

double frequency_at_speed(double speed_mps) {
  if (speed_mps < kStands_mps) return kIdle_hz;
  const double gears = speed_mps / kGear_mps;
  return kGearFrom_hz + kGearSpan_hz * (gears - std::floor(gears));
}

}  // namespace

Engine::Engine(const std::function<double(double)>& speed_at, double duration_s, std::uint64_t seed) {
  Random random(seed, "engine");
  const auto nodes = static_cast<std::size_t>(std::ceil(std::max(0.0, duration_s) / kStep_s)) + 2;
  const double memory = std::exp(-kStep_s / kWanderTau_s);
  double wander_hz = kWanderSd_hz * random.normal();
  double phase_rad = 0.0;
  for (std::size_t i = 0; i < nodes; ++i) {
    const double frequency_hz = std::clamp(
        frequency_at_speed(speed_at(static_cast<double>(i) * kStep_s)) + wander_hz, kLowest_hz, kHighest_hz);
    if (i > 0) phase_rad += std::numbers::pi * kStep_s * (frequency_hz_.back() + frequency_hz);
    frequency_hz_.push_back(frequency_hz);
    phase_rad_.push_back(phase_rad);
    wander_hz = memory * wander_hz + kWanderSd_hz * std::sqrt(1.0 - memory * memory) * random.normal();
  }
}

Engine::Point Engine::at(double t_s) const {
  constexpr double kTurn = 2.0 * std::numbers::pi;
  const double last_s = static_cast<double>(frequency_hz_.size() - 1) * kStep_s;
  if (t_s <= 0.0 || t_s >= last_s) {
    const bool before = t_s <= 0.0;
    const double frequency_hz = before ? frequency_hz_.front() : frequency_hz_.back();
    const double phase_rad = before ? phase_rad_.front() : phase_rad_.back();
    return {phase_rad + kTurn * frequency_hz * (before ? t_s : t_s - last_s), kTurn * frequency_hz,
            frequency_hz / kIdle_hz, 0.0};
  }
  const auto i = std::min(static_cast<std::size_t>(t_s / kStep_s), frequency_hz_.size() - 2);
  const double since_s = t_s - static_cast<double>(i) * kStep_s;
  const double slope_hz_per_s = (frequency_hz_[i + 1] - frequency_hz_[i]) / kStep_s;
  const double frequency_hz = frequency_hz_[i] + slope_hz_per_s * since_s;
  return {phase_rad_[i] + std::numbers::pi * since_s * (frequency_hz_[i] + frequency_hz),
          kTurn * frequency_hz, frequency_hz / kIdle_hz, slope_hz_per_s / kIdle_hz};
}

VibrationClass VibrationClass::times(double factor) const {
  VibrationClass result = *this;
  for (double& f : result.f_rms_mps2) f *= factor;
  for (double& omega : result.omega_rms_radps) omega *= factor;
  return result;
}

// a cos + b sin has the mean square (a^2 + b^2) / 2: with a and b normal of that sd, its expectation is sd^2.
Vibration::Vibration(const VibrationClass& vibration, Random random) {
  for (std::size_t i = 0; i < kEngineOrders; ++i) {
    lines_[i].f_cosine = draw3(random, vibration.f_rms_mps2[i]);
    lines_[i].f_sine = draw3(random, vibration.f_rms_mps2[i]);
    lines_[i].omega_cosine = draw3(random, vibration.omega_rms_radps[i]);
    lines_[i].omega_sine = draw3(random, vibration.omega_rms_radps[i]);
  }
}

Vibration::Point Vibration::at(const Engine::Point& engine) const {
  Point sum{Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
  for (std::size_t i = 0; i < kEngineOrders; ++i) {
    const double order = static_cast<double>(i + 1);
    const double cosine = std::cos(order * engine.phase_rad);
    const double sine = std::sin(order * engine.phase_rad);
    const Line& line = lines_[i];
    sum.f_mps2 += engine.strength * (cosine * line.f_cosine + sine * line.f_sine);
    const Eigen::Vector3d omega = cosine * line.omega_cosine + sine * line.omega_sine;
    const Eigen::Vector3d quarter_later = cosine * line.omega_sine - sine * line.omega_cosine;
    sum.omega_radps += engine.strength * omega;
    sum.omega_dot_radps2 +=
        engine.strength_per_s * omega + engine.strength * order * engine.rate_radps * quarter_later;
  }
  return sum;
}

}  // namespace imusim
