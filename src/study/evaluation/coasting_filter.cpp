#include "study/evaluation/coasting_filter.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

#include "base/contracts.h"
#include "estimation/navigation/so3.h"
#include "estimation/navigation/strapdown.h"

namespace imuscope {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr Eigen::Index kKinematic = kNavigationKinematicSize;
/// The covariance goes in steps of this length, the state in steps of a sample.
constexpr double kCovarianceStep_s = 0.05;
/// Re-acquisition, as in the live filter: velocity is uncertain by this much.
constexpr double kReacquireVelocitySd_mps = 3.0;

Matrix3d turned_density(const Matrix3d& C_s_n, const double* density) {
  return C_s_n * Vector3d(density[0], density[1], density[2]).asDiagonal() * C_s_n.transpose();
}

/// (1 - exp(-x)) / x: mean over a step of what decays with it.
double mean_decay(double x) { return x > 0.0 ? -std::expm1(-x) / x : 1.0; }

}  // namespace

CoastingFilter::CoastingFilter(const CoastingModel& model, const NavigationState& start,
                               const KinematicVector& sd)
    : state_(start) {
  // V-1: a constant and the slow processes of every axis
  std::vector<double> variances;
  for (std::size_t axis = 0; axis < kImuAxes; ++axis) {
    const AxisNoise& noise = model.axes[axis];
    IMUSCOPE_EXPECTS(noise.slow.size() <= kSlowMax);
    const auto component = static_cast<Eigen::Index>(axis % 3);
    const double first = axis < 3 ? start.gyro_bias_b_radps[component] : start.accel_bias_b_mps2[component];
    biases_.push_back({axis, 0.0, 0.0, noise.walk_density, first});
    variances.push_back(noise.turn_on_variance);
    for (const SlowProcess& process : noise.slow) {
      IMUSCOPE_EXPECTS(process.rate_per_s > 0.0);
      biases_.push_back({axis, process.rate_per_s, process.variance, 0.0, 0.0});
      variances.push_back(process.variance);
    }
  }
  const Eigen::Index n = kKinematic + static_cast<Eigen::Index>(biases_.size());
  P_ = StateMatrix::Zero(n, n);
  P_.diagonal().head<kKinematic>() = sd.cwiseAbs2();
  P_.diagonal().tail(n - kKinematic) =
      Eigen::Map<const Eigen::VectorXd>(variances.data(), static_cast<Eigen::Index>(variances.size()));
  pending_.begin = state_;
}

// V-1: b
void CoastingFilter::sum_biases() {
  state_.gyro_bias_b_radps.setZero();
  state_.accel_bias_b_mps2.setZero();
  for (const Bias& bias : biases_) {
    const auto component = static_cast<Eigen::Index>(bias.axis % 3);
    (bias.axis < 3 ? state_.gyro_bias_b_radps : state_.accel_bias_b_mps2)[component] += bias.value;
  }
}

void CoastingFilter::propagate(const InertialRates& begin, const InertialRates& end, double dt_s,
                               const std::array<double, kImuAxes>& white_density) {
  IMUSCOPE_EXPECTS(dt_s > 0.0 && dt_s <= kStepMax_s);
  if (pending_.dt_s == 0.0) pending_.begin = state_;
  const InertialRates first = compensated(begin, state_);
  const InertialRates last = compensated(end, state_);
  pending_.omega_sum += 0.5 * dt_s * (first.omega_ib_b_radps + last.omega_ib_b_radps);
  pending_.f_sum += 0.5 * dt_s * (first.f_b_mps2 + last.f_b_mps2);
  for (std::size_t i = 0; i < kImuAxes; ++i) pending_.density_sum[i] += dt_s * white_density[i];
  pending_.dt_s += dt_s;
  imuscope::propagate(state_, increment_from_samples(first, last, dt_s));
  if (pending_.dt_s >= kCovarianceStep_s) settle();
}

// V-2, V-3
void CoastingFilter::settle() {
  const double dt_s = pending_.dt_s;
  if (dt_s == 0.0) return;
  NavigationState middle = pending_.begin;
  middle.C_b_n = middle.C_b_n * exp_so3(0.5 * pending_.omega_sum);
  const InertialRates mean{pending_.omega_sum / dt_s, pending_.f_sum / dt_s};
  // Constant biases and no noise: the rows of the kinematics alone.
  constexpr double kForever = std::numeric_limits<double>::infinity();
  const NavigationTransition step =
      transition(middle, mean, {0.0, 0.0, {0.0, kForever}, {0.0, kForever}}, dt_s);

  const Eigen::Index n = P_.rows();
  const auto m = n - kKinematic;
  // V-2: Phi
  Eigen::Matrix<double, kKinematic, Eigen::Dynamic> rows(kKinematic, n);
  rows.leftCols<kKinematic>() = step.kinematic_rows.leftCols<kKinematic>();
  Eigen::VectorXd decay(m);
  for (Eigen::Index j = 0; j < m; ++j) {
    const Bias& bias = biases_[static_cast<std::size_t>(j)];
    const double x = bias.rate_per_s * dt_s;
    rows.col(kKinematic + j) =
        mean_decay(x) * step.kinematic_rows.col(kKinematic + static_cast<Eigen::Index>(bias.axis));
    decay[j] = std::exp(-x);
  }

  const Eigen::Matrix<double, kKinematic, Eigen::Dynamic> carried = rows * P_;
  P_.topLeftCorner<kKinematic, kKinematic>() = carried * rows.transpose();
  P_.topRightCorner(kKinematic, m) = carried.rightCols(m) * decay.asDiagonal();
  P_.bottomLeftCorner(m, kKinematic) = P_.topRightCorner(kKinematic, m).transpose();
  P_.bottomRightCorner(m, m) = decay.asDiagonal() * P_.bottomRightCorner(m, m) * decay.asDiagonal();

  // V-3: Q
  KinematicCovariance white = KinematicCovariance::Zero();
  white.block<3, 3>(kVelocityError, kVelocityError) = turned_density(middle.C_b_n, &pending_.density_sum[3]);
  white.block<3, 3>(kAttitudeError, kAttitudeError) =
      turned_density(middle.C_b_n, pending_.density_sum.data());
  const auto A = rows.leftCols<kKinematic>();
  P_.topLeftCorner<kKinematic, kKinematic>() += 0.5 * (white + A * white * A.transpose());
  for (Eigen::Index j = 0; j < m; ++j) {
    Bias& bias = biases_[static_cast<std::size_t>(j)];
    P_(kKinematic + j, kKinematic + j) +=
        bias.walk_density * dt_s - bias.variance * std::expm1(-2.0 * bias.rate_per_s * dt_s);
    bias.value *= decay[j];
  }
  sum_biases();
  add_second_order(mean.f_b_mps2.norm(), dt_s);
  pending_ = {};
}

// V-7
void CoastingFilter::add_second_order(double specific_force_mps2, double dt_s) {
  const double north = P_(kAttitudeError, kAttitudeError);
  const double east = P_(kAttitudeError + 1, kAttitudeError + 1);
  const double both = P_(kAttitudeError, kAttitudeError + 1);
  const double fourth_moment = 3.0 * (north * north + east * east) + 2.0 * north * east + 4.0 * both * both;
  const double force_mps2 = 0.5 * specific_force_mps2 * std::sqrt(fourth_moment);
  second_order_r_m_ += (second_order_v_mps_ + 0.5 * force_mps2 * dt_s) * dt_s;
  second_order_v_mps_ += force_mps2 * dt_s;
}

KinematicCovariance CoastingFilter::covariance() {
  settle();
  constexpr Eigen::Index kDown = 2;
  KinematicCovariance all = P_.topLeftCorner<kKinematic, kKinematic>();
  all(kPositionError + kDown, kPositionError + kDown) += second_order_r_m_ * second_order_r_m_;
  all(kVelocityError + kDown, kVelocityError + kDown) += second_order_v_mps_ * second_order_v_mps_;
  all(kPositionError + kDown, kVelocityError + kDown) += second_order_r_m_ * second_order_v_mps_;
  all(kVelocityError + kDown, kPositionError + kDown) += second_order_r_m_ * second_order_v_mps_;
  return all;
}

bool CoastingFilter::update_position(HostTime time, const GeodeticPosition& antenna, const Vector3d& sd_m,
                                     const Vector3d& r_sa_s_m) {
  settle();
  return update(position_gate_, time, gnss_position_innovation(state_, antenna, r_sa_s_m), sd_m);
}

bool CoastingFilter::update_velocity(HostTime time, const Vector3d& v_n_mps, const Vector3d& sd_mps,
                                     const InertialRates& measured, const Vector3d& r_sa_s_m) {
  settle();
  return update(velocity_gate_, time,
                gnss_velocity_innovation(state_, v_n_mps, measured.omega_ib_b_radps, r_sa_s_m), sd_mps);
}

// V-4
bool CoastingFilter::update(GnssGate& gate, HostTime time, const GnssInnovation& measured,
                            const Vector3d& sd) {
  const Eigen::Index n = P_.rows();
  Eigen::Matrix<double, 3, Eigen::Dynamic> H(3, n);
  H.leftCols<kKinematic>() = measured.H.leftCols<kKinematic>();
  for (Eigen::Index j = kKinematic; j < n; ++j) {
    const auto axis = static_cast<Eigen::Index>(biases_[static_cast<std::size_t>(j - kKinematic)].axis);
    H.col(j) = measured.H.col(kKinematic + axis);
  }
  const Matrix3d R = sd.cwiseAbs2().asDiagonal();
  Eigen::Matrix<double, Eigen::Dynamic, 3> PHt = P_ * H.transpose();
  Matrix3d S = H * PHt + R;
  const GateDecision decision = gate.decide(time, measured.innovation, S, R);
  if (decision == GateDecision::kReject) return false;
  if (decision == GateDecision::kReacquire) {
    P_.diagonal().segment<3>(kPositionError) += measured.innovation.cwiseAbs2();
    P_.diagonal().segment<3>(kVelocityError).array() += kReacquireVelocitySd_mps * kReacquireVelocitySd_mps;
    PHt = P_ * H.transpose();
    S = H * PHt + R;
  }
  const Eigen::LLT<Matrix3d> S_root(S);
  // W W^T = P H^T S^-1 H P
  const Eigen::Matrix<double, Eigen::Dynamic, 3> W = S_root.matrixL().solve(PHt.transpose()).transpose();
  const Eigen::VectorXd correction = PHt * S_root.solve(measured.innovation);
  P_ -= W * W.transpose();
  NavigationErrorVector kinematic = NavigationErrorVector::Zero();
  kinematic.head<kKinematic>() = correction.head<kKinematic>();
  inject(state_, kinematic);
  for (std::size_t j = 0; j < biases_.size(); ++j)
    biases_[j].value += correction[kKinematic + static_cast<Eigen::Index>(j)];
  sum_biases();
  second_order_v_mps_ = second_order_r_m_ = 0.0;
  return true;
}

}  // namespace imuscope
