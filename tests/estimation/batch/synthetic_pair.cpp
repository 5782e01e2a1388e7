#include "synthetic_pair.h"

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <random>
#include <span>
#include <vector>

namespace synthetic {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

struct Sine {
  Vector3d amplitude;
  double omega;
  double phase;
};

/// Rates below 3 Hz and forces below 4 Hz of a car on a winding, uneven road.
struct Body {
  const Vector3d kAboveAxle_m{0.1, 0.0, -0.5};
  std::array<Sine, 14> rates;
  std::array<Sine, 14> forces;
  std::vector<Sine> road;  ///< rates; the forces that go with them are those of a point above the axle

  Body(const PairOptions& options, std::mt19937_64& random) {
    std::uniform_real_distribution<double> phase(0.0, 6.28);
    std::normal_distribution<double> normal;
    for (std::size_t i = 0; i < rates.size(); ++i) {
      const double f_hz = 0.04 * std::pow(1.4, static_cast<double>(i));
      const double yaw = f_hz < 0.3 ? 0.12 : 0.02;
      const double size = options.turns ? options.motion : 0.0;
      rates[i] = {size * Vector3d{0.02 * normal(random), 0.02 * normal(random), yaw * normal(random)},
                  6.283185307179586 * f_hz, phase(random)};
      forces[i] = {options.motion * 0.4 * Vector3d{normal(random), normal(random), normal(random)},
                   6.283185307179586 * f_hz * 1.07, phase(random)};
    }
    if (options.road_rate == 0.0) return;
    for (int i = 0; i < 40; ++i) {
      const Vector3d amplitude{normal(random), normal(random), 0.2 * normal(random)};
      road.push_back({options.road_rate * amplitude, 6.283185307179586 * (1.03 + 0.2 * i), phase(random)});
    }
  }
  [[nodiscard]] Vector3d omega(double t) const { return sum(rates, t, 0) + sum(road, t, 0); }
  [[nodiscard]] Vector3d omega_dot(double t) const { return sum(rates, t, 1) + sum(road, t, 1); }
  [[nodiscard]] Vector3d force_dot(double t) const {
    return sum(forces, t, 1) + sum(road, t, 2).cross(kAboveAxle_m);
  }
  [[nodiscard]] Vector3d force(double t) const {
    return Vector3d(0.0, 0.0, -9.81) + sum(forces, t, 0) + sum(road, t, 1).cross(kAboveAxle_m);
  }

 private:
  static Vector3d sum(std::span<const Sine> sines, double t, int derivative) {
    constexpr double kQuarter = 1.5707963267948966;
    Vector3d total = Vector3d::Zero();
    for (const Sine& s : sines)
      total += s.amplitude * std::pow(s.omega, derivative) *
               std::sin(s.omega * t + s.phase + derivative * kQuarter);
    return total;
  }
};

class White {
 public:
  White(double density, double rate_hz) : sd_(density * std::sqrt(rate_hz)) {}
  Vector3d operator()(std::mt19937_64& random) {
    return sd_ * Vector3d{normal_(random), normal_(random), normal_(random)};
  }

 private:
  double sd_;
  std::normal_distribution<double> normal_;
};

Vector3d force_at(const Body& body, double t, const Vector3d& arm) {
  const Vector3d w = body.omega(t);
  return body.force(t) + body.omega_dot(t).cross(arm) + w.cross(w.cross(arm));
}

}  // namespace

Pair make_pair(const PairOptions& o, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const Body body(o, random);
  Pair pair;
  // The gyros' density in one-sided sense is sqrt(2) the two-sided one; sd of a sample = density sqrt(rate /
  // 2).
  White reference_gyro(o.reference_gyro_white / std::sqrt(2.0), o.reference_rate_hz);
  White reference_accel(o.reference_accel_white / std::sqrt(2.0), o.reference_rate_hz);
  White study_gyro(o.study_gyro_white / std::sqrt(2.0), o.study_rate_hz);
  White study_accel(o.study_accel_white / std::sqrt(2.0), o.study_rate_hz);
  for (int i = 0; i < static_cast<int>(o.duration_s * o.reference_rate_hz); ++i) {
    const double t = i / o.reference_rate_hz;
    pair.reference.add(t, (o.reference_gyro_matrix * body.omega(t) + reference_gyro(random)).cast<float>(),
                       (o.reference_accel_matrix * body.force(t) + reference_accel(random)).cast<float>());
  }
  std::uniform_real_distribution<double> uniform;
  for (int i = 0; i < static_cast<int>(o.duration_s * o.study_rate_hz); ++i) {
    const double own = (i + 0.3) / o.study_rate_hz;
    const double t = own + o.t_d_s + o.clock_rate * (own - 0.5 * o.duration_s);
    const Vector3d gyro = o.gyro_matrix * o.C_b_s * (body.omega(t) + o.compliance_b * body.force_dot(t)) +
                          o.gyro_bias + study_gyro(random);
    Vector3d accel = o.accel_bias + study_accel(random);
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      const Vector3d arm = o.r_bs_b_m + o.C_b_s.transpose() * o.places_s_m.row(axis).transpose();
      const Vector3d force = force_at(body, t + o.accel_delay_s, arm);
      const Vector3d turn = o.compliance_b * (body.force(t + o.accel_delay_s) - Vector3d(0.0, 0.0, -9.81));
      accel[axis] += (o.accel_matrix * o.C_b_s * (force + force.cross(turn)))[axis];
    }
    if (uniform(random) < o.lost_share) continue;
    pair.study.add(own, gyro.cast<float>(), accel.cast<float>());
  }
  return pair;
}

}  // namespace synthetic
