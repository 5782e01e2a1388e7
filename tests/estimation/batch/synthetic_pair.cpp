#include "synthetic_pair.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
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

const Vector3d kUpright_mps2(0.0, 0.0, -9.81);

class Body {
 public:
  Body() = default;
  Body(const Body&) = delete;
  Body& operator=(const Body&) = delete;
  virtual ~Body() = default;
  [[nodiscard]] virtual Vector3d omega(double t) const = 0;
  [[nodiscard]] virtual Vector3d omega_dot(double t) const = 0;
  [[nodiscard]] virtual Vector3d force(double t) const = 0;
  [[nodiscard]] virtual Vector3d force_dot(double t) const = 0;
};

/// Rates below 3 Hz and forces below 4 Hz of a car on a winding, uneven road.
struct Car final : Body {
  const Vector3d kAboveAxle_m{0.1, 0.0, -0.5};
  std::array<Sine, 14> rates;
  std::array<Sine, 14> forces;
  std::vector<Sine> road;  ///< rates; the forces that go with them are those of a point above the axle

  Car(const PairOptions& options, std::mt19937_64& random) {
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
    const auto add_road = [&](double rate, int lines, double from_hz, double step_hz) {
      for (int i = 0; i < lines && rate > 0.0; ++i) {
        const Vector3d amplitude{normal(random), normal(random), 0.2 * normal(random)};
        road.push_back({rate * amplitude, 6.283185307179586 * (from_hz + step_hz * i), phase(random)});
      }
    };
    add_road(options.road_rate, 40, 1.03, 0.2);
    for (int i = 0; i < 60 && options.hop_rate > 0.0; ++i)
      add_road(options.hop_rate, 1, 5.0 + 0.15 * (i + phase(random) / 6.28), 0.0);
  }
  [[nodiscard]] Vector3d omega(double t) const override { return sum(rates, t, 0) + sum(road, t, 0); }
  [[nodiscard]] Vector3d omega_dot(double t) const override { return sum(rates, t, 1) + sum(road, t, 1); }
  [[nodiscard]] Vector3d force_dot(double t) const override {
    return sum(forces, t, 1) + sum(road, t, 2).cross(kAboveAxle_m);
  }
  [[nodiscard]] Vector3d force(double t) const override {
    return kUpright_mps2 + sum(forces, t, 0) + sum(road, t, 1).cross(kAboveAxle_m);
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

/// Quarter turns by hand about its own axes, more or less, with rests between them.
class Laid final : public Body {
 public:
  Laid(const PairOptions& options, std::mt19937_64& random) {
    std::normal_distribution<double> normal;
    Matrix3d C_b_n = Matrix3d::Identity();
    for (Eigen::Index i = 0; kTurnEvery_s * static_cast<double>(i) < options.duration_s; ++i) {
      const Vector3d turn =
          1.6 * Vector3d::Unit(i % 3) + 0.2 * Vector3d{normal(random), normal(random), normal(random)};
      turns_.push_back({turn, C_b_n});
      C_b_n = (C_b_n * rotation(turn)).eval();
    }
  }
  [[nodiscard]] Vector3d omega(double t) const override {
    const double u = share(t);
    return 30.0 * u * u * (1.0 - u) * (1.0 - u) / kTurn_s * of(t).turn;
  }
  [[nodiscard]] Vector3d omega_dot(double t) const override {
    const double u = share(t);
    return 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / (kTurn_s * kTurn_s) * of(t).turn;
  }
  [[nodiscard]] Vector3d force(double t) const override {
    const double u = share(t);
    const double turned = u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
    return (of(t).C_b_n * rotation(turned * of(t).turn)).transpose() * kUpright_mps2;
  }
  [[nodiscard]] Vector3d force_dot(double t) const override { return force(t).cross(omega(t)); }

 private:
  static constexpr double kTurnEvery_s = 15.0;
  static constexpr double kFirst_s = 10.0;
  static constexpr double kTurn_s = 3.0;
  struct Turn {
    Vector3d turn;
    Matrix3d C_b_n;  ///< before it
  };
  static Matrix3d rotation(const Vector3d& turn) {
    return Eigen::AngleAxisd(turn.norm(),
                             turn.norm() > 0.0 ? Vector3d(turn.normalized()) : Vector3d(Vector3d::UnitX()))
        .toRotationMatrix();
  }
  [[nodiscard]] std::size_t number(double t) const {
    return std::min(turns_.size() - 1, static_cast<std::size_t>(std::max(0.0, t / kTurnEvery_s)));
  }
  [[nodiscard]] const Turn& of(double t) const { return turns_[number(t)]; }
  /// 0 before the turn, 1 after it
  [[nodiscard]] double share(double t) const {
    return std::clamp((t - kTurnEvery_s * static_cast<double>(number(t)) - kFirst_s) / kTurn_s, 0.0, 1.0);
  }

  std::vector<Turn> turns_;
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

/// What the S-IMU shows without bias and noise: rates, then forces.
using Shown = Eigen::Matrix<double, 6, 1>;
Shown shown(const Body& body, const PairOptions& o, double t) {
  Shown all;
  all.head<3>() = o.gyro_matrix * o.C_b_s * (body.omega(t) + o.compliance_b * body.force_dot(t));
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const Vector3d arm = o.r_bs_b_m + o.C_b_s.transpose() * o.places_s_m.row(axis).transpose();
    const Vector3d force = force_at(body, t + o.accel_delay_s, arm);
    const Vector3d turn = o.compliance_b * (body.force(t + o.accel_delay_s) - kUpright_mps2);
    all[3 + axis] = (o.accel_matrix * o.C_b_s * (force + force.cross(turn)))[axis];
  }
  return all;
}

constexpr double kFine_hz = 1000.0;
double prewarped(double corner_hz) { return std::tan(1.5707963267948966 * 2.0 * corner_hz / kFine_hz); }

/// The same behind a low-pass, at instants that are asked for in order: bilinear transform at kFine_hz, straight lines
/// between.
class LowPassed {
 public:
  LowPassed(const Body& body, const PairOptions& options, double from_s)
      : body_(body), options_(options), k_(prewarped(options.study_low_pass_hz)), t_s_(from_s) {
    in_[0] = in_[1] = in_[2] = out_[0] = out_[1] = out_[2] = shown(body, options, from_s);
  }
  Shown at(double t_s) {
    while (t_s_ < t_s) step();
    const double late = (t_s_ - t_s) * kFine_hz;
    return late * out_[1] + (1.0 - late) * out_[0];
  }

 private:
  void step() {
    t_s_ += 1.0 / kFine_hz;
    in_ = {shown(body_, options_, t_s_), in_[0], in_[1]};
    const double norm = 1.0 + std::sqrt(2.0) * k_ + k_ * k_;
    const Shown next = (k_ * k_ * (in_[0] + 2.0 * in_[1] + in_[2]) - 2.0 * (k_ * k_ - 1.0) * out_[0] -
                        (1.0 - std::sqrt(2.0) * k_ + k_ * k_) * out_[1]) /
                       norm;
    out_ = {next, out_[0], out_[1]};
  }

  const Body& body_;
  const PairOptions& options_;
  double k_;
  double t_s_;
  std::array<Shown, 3> in_;
  std::array<Shown, 3> out_;
};

}  // namespace

double low_pass_delay_s(double corner_hz) { return std::sqrt(2.0) / (2.0 * kFine_hz * prewarped(corner_hz)); }

Pair make_pair(const PairOptions& o, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::unique_ptr<Body> moved;
  if (o.laid_on_sides)
    moved = std::make_unique<Laid>(o, random);
  else
    moved = std::make_unique<Car>(o, random);
  const Body& body = *moved;
  Pair pair;
  // The gyros' density in one-sided sense is sqrt(2) the two-sided one; sd of a sample = density sqrt(rate /
  // 2).
  White reference_gyro(o.reference_gyro_white / std::sqrt(2.0), o.reference_rate_hz);
  White reference_accel(o.reference_accel_white / std::sqrt(2.0), o.reference_rate_hz);
  White study_gyro(o.study_gyro_white / std::sqrt(2.0), o.study_rate_hz);
  White study_accel(o.study_accel_white / std::sqrt(2.0), o.study_rate_hz);
  for (int i = 0; i < static_cast<int>(o.duration_s * o.reference_rate_hz); ++i) {
    const double t = i / o.reference_rate_hz;
    pair.reference.add(
        t, (o.reference_gyro_matrix * body.omega(t) + reference_gyro(random)).cast<float>(),
        (o.reference_accel_matrix * body.force(t - o.reference_accel_delay_s) + reference_accel(random))
            .cast<float>());
  }
  std::uniform_real_distribution<double> uniform;
  LowPassed low_passed(body, o, o.t_d_s - 1.0);
  for (int i = 0; i < static_cast<int>(o.duration_s * o.study_rate_hz); ++i) {
    const double own = (i + 0.3) / o.study_rate_hz;
    const double t = own + o.t_d_s + o.clock_rate * (own - 0.5 * o.duration_s);
    const Shown motion = o.study_low_pass_hz > 0.0 ? low_passed.at(t) : shown(body, o, t);
    const Vector3d gyro = motion.head<3>() + o.gyro_bias + study_gyro(random);
    const Vector3d accel = motion.tail<3>() + o.accel_bias + study_accel(random);
    if (uniform(random) < o.lost_share) continue;
    pair.study.add(own, gyro.cast<float>(), accel.cast<float>());
  }
  return pair;
}

}  // namespace synthetic
