#pragma once

/// Motion in closed form: sums of sines with exact derivatives, in the amplitudes of a passenger car.

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

namespace imuscope::test {

/// A vector signal with its derivatives.
class SineSum {
 public:
  struct Band {
    double frequency_low_hz, frequency_high_hz;
    Eigen::Vector3d amplitude;
    int count;
  };

  SineSum(unsigned seed, const Eigen::Vector3d& mean, std::initializer_list<Band> bands) : mean_(mean) {
    std::mt19937 random(seed);
    for (const Band& band : bands) {
      for (int i = 0; i < band.count; ++i) {
        std::uniform_real_distribution<> frequency(band.frequency_low_hz, band.frequency_high_hz);
        std::uniform_real_distribution<> phase(0.0, 2.0 * std::numbers::pi);
        for (int axis = 0; axis < 3; ++axis) {
          terms_.push_back(
              {axis, band.amplitude[axis], 2.0 * std::numbers::pi * frequency(random), phase(random)});
        }
      }
    }
  }

  /// The n-th derivative at t.
  [[nodiscard]] Eigen::Vector3d derivative(double t, int n) const {
    Eigen::Vector3d out = n == 0 ? mean_ : Eigen::Vector3d::Zero().eval();
    for (const Term& s : terms_) {
      out[s.axis] +=
          s.amplitude * std::pow(s.rate, n) * std::sin(s.rate * t + s.phase + 0.5 * std::numbers::pi * n);
    }
    return out;
  }
  [[nodiscard]] Eigen::Vector3d operator()(double t) const { return derivative(t, 0); }

  /// Mean over [t0, t1].
  [[nodiscard]] Eigen::Vector3d mean(double t0, double t1) const {
    Eigen::Vector3d out = mean_;
    for (const Term& s : terms_) {
      out[s.axis] -= s.amplitude * (std::cos(s.rate * t1 + s.phase) - std::cos(s.rate * t0 + s.phase)) /
                     (s.rate * (t1 - t0));
    }
    return out;
  }

 private:
  struct Term {
    int axis;
    double amplitude, rate, phase;
  };
  Eigen::Vector3d mean_;
  std::vector<Term> terms_;
};

/// Rates of a car in town: yaw in slow turns, roll and pitch from the road.
inline SineSum car_rates(unsigned seed) {
  return {seed,
          Eigen::Vector3d::Zero(),
          {{0.03, 0.15, {0.0, 0.0, 0.08}, 4},
           {0.3, 1.5, {0.010, 0.008, 0.004}, 6},
           {2.0, 5.0, {0.004, 0.004, 0.001}, 4}}};
}
/// Specific force of a car in town.
inline SineSum car_forces(unsigned seed) {
  return {
      seed + 1000,
      Eigen::Vector3d(0.0, 0.0, -9.81),
      {{0.03, 0.15, {0.5, 0.4, 0.02}, 4}, {0.3, 1.5, {0.1, 0.1, 0.15}, 6}, {2.0, 5.0, {0.05, 0.05, 0.1}, 4}}};
}

}  // namespace imuscope::test
