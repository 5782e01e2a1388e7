#pragma once

/// The engine of the simulated vehicle, and what its vibration does to a body: lines at the firing frequency
/// and twice it, which wander as the engine's speed does. Whatever hangs on the engine follows one phase, so
/// what two sensors feel of it is coherent, as on a vehicle, however different their mounts are.
///
/// The firing frequency stays within 22 and 46 Hz: no line folds to below 8 Hz in readings at 100 Hz.

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "firmware_sim/random/random.h"

namespace imusim {

/// Lines: the firing frequency and its first overtone.
inline constexpr std::size_t kEngineOrders = 2;

class Engine {
 public:
  struct Point {
    double phase_rad;
    double rate_radps;  ///< d phase / dt
    double strength;    ///< of the vibration, 1 when idle; grows with the engine's speed
    double strength_per_s;
  };

  /// @param speed_at  the vehicle's speed in m/s at a time in s, from which the engine's follows by gears;
  ///                  asked from 0 to duration_s, and not kept
  Engine(const std::function<double(double)>& speed_at, double duration_s, std::uint64_t seed);

  /// Valid for any time: before 0 and after the end the engine runs on as it did there.
  [[nodiscard]] Point at(double t_s) const;

 private:
  std::vector<double> frequency_hz_;  ///< every kStep_s from 0, straight in between
  std::vector<double> phase_rad_;
};

/// Root mean square per axis of each line while the engine idles.
struct VibrationClass {
  std::array<double, kEngineOrders> f_rms_mps2{0.10, 0.05};
  std::array<double, kEngineOrders> omega_rms_radps{5e-4, 2.5e-4};  ///< 0.03 and 0.015 deg/s
  /// The same with every line weaker or stronger by a factor.
  [[nodiscard]] VibrationClass times(double factor) const;
};

/// How one body vibrates with an engine: amplitude and phase of every line in every axis, drawn once.
class Vibration {
 public:
  Vibration(const VibrationClass& vibration, Random random);

  struct Point {
    Eigen::Vector3d f_mps2;
    Eigen::Vector3d omega_radps;
    Eigen::Vector3d omega_dot_radps2;  ///< d omega / dt
  };
  [[nodiscard]] Point at(const Engine::Point& engine) const;

 private:
  struct Line {
    Eigen::Vector3d f_cosine;
    Eigen::Vector3d f_sine;
    Eigen::Vector3d omega_cosine;
    Eigen::Vector3d omega_sine;
  };
  std::array<Line, kEngineOrders> lines_;
};

}  // namespace imusim
