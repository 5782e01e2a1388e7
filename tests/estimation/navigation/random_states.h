#pragma once

/// Random navigation states and rates of a vehicle, for checks that must hold anywhere.

#include <Eigen/Core>
#include <random>

#include "base/units.h"
#include "estimation/navigation/navigation_state.h"
#include "estimation/navigation/so3.h"

namespace imuscope::test {

class RandomStates {
 public:
  explicit RandomStates(unsigned seed) : random_(seed) {}

  double uniform(double low, double high) { return std::uniform_real_distribution<>(low, high)(random_); }
  double normal(double sd) { return std::normal_distribution<>(0.0, sd)(random_); }
  Eigen::Vector3d normal3(double sd) { return {normal(sd), normal(sd), normal(sd)}; }

  NavigationState state() {
    NavigationState s;
    s.position = {uniform(-75.0, 75.0) * kRadPerDeg, uniform(-180.0, 180.0) * kRadPerDeg,
                  uniform(-100.0, 3000.0)};
    s.v_n_mps = {uniform(-30.0, 30.0), uniform(-30.0, 30.0), uniform(-3.0, 3.0)};
    s.C_b_n = exp_so3({uniform(-1.8, 1.8), uniform(-1.8, 1.8), uniform(-1.8, 1.8)});
    s.gyro_bias_b_radps = normal3(1e-3);
    s.accel_bias_b_mps2 = normal3(0.05);
    return s;
  }
  /// Compensated rates of a lively drive.
  InertialRates rates() {
    return {normal3(0.3), Eigen::Vector3d(normal(2.0), normal(2.0), -9.8 + normal(1.0))};
  }

 private:
  std::mt19937 random_;
};

}  // namespace imuscope::test
