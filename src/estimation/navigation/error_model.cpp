#include "estimation/navigation/error_model.h"

#include <cmath>

#include "base/units.h"
#include "estimation/navigation/local_earth.h"
#include "estimation/navigation/so3.h"

namespace imuscope {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// The blocks of three of F, by name.
template <typename Matrix>
auto block(Matrix& m, NavigationErrorBlock row, NavigationErrorBlock column) {
  return m.template block<3, 3>(row, column);
}

// N-21: d(dr')/d(dr)
Matrix3d position_feedback(const LocalEarth& earth, const Vector3d& v) noexcept {
  Matrix3d F = Matrix3d::Zero();
  F(0, 0) = -v.z() / earth.M;
  F(0, 2) = v.x() / earth.M;
  F(1, 0) = v.y() * earth.tan_L / earth.N;
  F(1, 1) = -(v.z() + v.x() * earth.tan_L) / earth.N;
  F(1, 2) = v.y() / earth.N;
  return F;
}

// N-22: d(w_en)/d(dr). A step dr_N changes the latitude by 1/M, dr_D the height by -1.
Matrix3d transport_rate_by_position(const LocalEarth& earth, const Vector3d& v) noexcept {
  const double per_N2 = 1.0 / (earth.N * earth.N);
  const double per_M2 = 1.0 / (earth.M * earth.M);
  Matrix3d D = Matrix3d::Zero();
  D(0, 0) = -v.y() * earth.curvature.transverse_slope_m * per_N2 / earth.M;
  D(0, 2) = v.y() * per_N2;
  D(1, 0) = v.x() * earth.curvature.meridian_slope_m * per_M2 / earth.M;
  D(1, 2) = -v.x() * per_M2;
  D(2, 0) = -v.y() *
            (1.0 / (earth.cos_L * earth.cos_L * earth.N) -
             earth.tan_L * earth.curvature.transverse_slope_m * per_N2) /
            earth.M;
  D(2, 2) = -v.y() * earth.tan_L * per_N2;
  return D;
}

// N-22: d(w_en)/d(dv)
Matrix3d transport_rate_by_velocity(const LocalEarth& earth) noexcept {
  Matrix3d D = Matrix3d::Zero();
  D(0, 1) = 1.0 / earth.N;
  D(1, 0) = -1.0 / earth.M;
  D(2, 1) = -earth.tan_L / earth.N;
  return D;
}

// N-22: d(w_ie)/d(dr)
Matrix3d earth_rate_by_position(const LocalEarth& earth) noexcept {
  Matrix3d D = Matrix3d::Zero();
  D(0, 0) = -kEarthRate_radps * earth.sin_L / earth.M;
  D(2, 0) = -kEarthRate_radps * earth.cos_L / earth.M;
  return D;
}

/// 1/T; 0 for a random constant.
double decay_rate(const BiasProcess& bias) noexcept {
  return std::isinf(bias.correlation_time_s) ? 0.0 : 1.0 / bias.correlation_time_s;
}

/// N-27. How long a turn, a braking or an acceleration of a road vehicle lasts.
constexpr double kManoeuvre_s = 5.0;

/// N-27: intensity on each axis of b.
Vector3d shown_by_motion(const Vector3d& motion_b, double scale_sd, double lean_variance) noexcept {
  const Vector3d squares = motion_b.cwiseAbs2();
  const double all = squares.sum();
  return kManoeuvre_s * (scale_sd * scale_sd * squares + lean_variance * (Vector3d::Constant(all) - squares));
}

/// F F, with the bias rows that F leaves out (plain decay), from the blocks that are not zero.
NavigationDynamics squared(const NavigationDynamics& F, double beta_g, double beta_a) noexcept {
  const Matrix3d r_r = block(F, kPositionError, kPositionError);
  const Matrix3d v_r = block(F, kVelocityError, kPositionError);
  const Matrix3d v_v = block(F, kVelocityError, kVelocityError);
  const Matrix3d v_p = block(F, kVelocityError, kAttitudeError);
  const Matrix3d v_a = block(F, kVelocityError, kAccelBiasError);
  const Matrix3d p_r = block(F, kAttitudeError, kPositionError);
  const Matrix3d p_v = block(F, kAttitudeError, kVelocityError);
  const Matrix3d p_p = block(F, kAttitudeError, kAttitudeError);
  const Matrix3d p_g = block(F, kAttitudeError, kGyroBiasError);
  NavigationDynamics S;
  // The block of dr by dv is the identity.
  block(S, kPositionError, kPositionError) = r_r * r_r + v_r;
  block(S, kPositionError, kVelocityError) = r_r + v_v;
  block(S, kPositionError, kAttitudeError) = v_p;
  block(S, kPositionError, kGyroBiasError).setZero();
  block(S, kPositionError, kAccelBiasError) = v_a;
  block(S, kVelocityError, kPositionError) = v_r * r_r + v_v * v_r + v_p * p_r;
  block(S, kVelocityError, kVelocityError) = v_r + v_v * v_v + v_p * p_v;
  block(S, kVelocityError, kAttitudeError) = v_v * v_p + v_p * p_p;
  block(S, kVelocityError, kGyroBiasError) = v_p * p_g;
  block(S, kVelocityError, kAccelBiasError) = v_v * v_a - beta_a * v_a;
  block(S, kAttitudeError, kPositionError) = p_r * r_r + p_v * v_r + p_p * p_r;
  block(S, kAttitudeError, kVelocityError) = p_r + p_v * v_v + p_p * p_v;
  block(S, kAttitudeError, kAttitudeError) = p_v * v_p + p_p * p_p;
  block(S, kAttitudeError, kGyroBiasError) = p_p * p_g - beta_g * p_g;
  block(S, kAttitudeError, kAccelBiasError) = p_v * v_a;
  return S;
}

/// White noise of rates and forces as it enters attitude and velocity: roots of the intensities, in n.
struct WhiteNoise {
  Matrix3d gyro_root_n;
  Matrix3d accel_root_n;
};

// N-26, N-27
WhiteNoise white_noise(const NavigationState& state, const NavigationProcessNoise& noise) noexcept {
  const auto root_n = [&C = state.C_b_n](double white, const Vector3d& by_motion) -> Matrix3d {
    const Vector3d root = (by_motion.array() + white * white).sqrt();
    return C * root.asDiagonal();
  };
  return {root_n(noise.gyro_noise_radps_per_sqrt_hz, noise.gyro_by_motion),
          root_n(noise.accel_noise_mps2_per_sqrt_hz, noise.accel_by_motion)};
}

// N-26: trapezoid of the intensities, the biases' own blocks exact.
void set_process_covariance(const WhiteNoise& white, const NavigationProcessNoise& noise, double beta_g,
                            double beta_a, double dt_s, NavigationTransition& step) noexcept {
  const double gyro_variance = noise.gyro_bias.sd * noise.gyro_bias.sd;
  const double accel_variance = noise.accel_bias.sd * noise.accel_bias.sd;
  const double gyro_bias_intensity = 2.0 * beta_g * gyro_variance;
  const double accel_bias_intensity = 2.0 * beta_a * accel_variance;
  const double half = 0.5 * dt_s;
  const auto column = [&](NavigationErrorBlock b) { return step.kinematic_rows.middleCols<3>(b); };

  // Columns of Phi times the root of their intensity: what noise enters through them. None enters through dr.
  Eigen::Matrix<double, kNavigationKinematicSize, 12> G;
  const double root_half = std::sqrt(half);
  G.middleCols<3>(0) = (root_half * column(kVelocityError)).lazyProduct(white.accel_root_n);
  G.middleCols<3>(3) = (root_half * column(kAttitudeError)).lazyProduct(white.gyro_root_n);
  G.middleCols<3>(6) = std::sqrt(half * gyro_bias_intensity) * column(kGyroBiasError);
  G.middleCols<3>(9) = std::sqrt(half * accel_bias_intensity) * column(kAccelBiasError);

  NavigationErrorCovariance& Q = step.process_covariance;
  Q.setZero();
  for (int i = 0; i < kNavigationKinematicSize; ++i) {
    for (int j = 0; j <= i; ++j) {
      const double sum = G.row(i).dot(G.row(j));
      Q(i, j) = sum;
      Q(j, i) = sum;
    }
  }
  const auto add_square = [&Q, half](NavigationErrorBlock first, const Matrix3d& root) {
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j <= i; ++j) {
        Q(first + i, first + j) += half * root.row(i).dot(root.row(j));
        Q(first + j, first + i) = Q(first + i, first + j);
      }
    }
  };
  add_square(kVelocityError, white.accel_root_n);
  add_square(kAttitudeError, white.gyro_root_n);
  Q.block<9, 3>(0, kGyroBiasError) =
      (half * gyro_bias_intensity * step.gyro_bias_decay) * column(kGyroBiasError);
  Q.block<9, 3>(0, kAccelBiasError) =
      (half * accel_bias_intensity * step.accel_bias_decay) * column(kAccelBiasError);
  Q.block<6, 9>(kGyroBiasError, 0) = Q.block<9, 6>(0, kGyroBiasError).transpose();
  Q.diagonal().segment<3>(kGyroBiasError).setConstant(-gyro_variance * std::expm1(-2.0 * beta_g * dt_s));
  Q.diagonal().segment<3>(kAccelBiasError).setConstant(-accel_variance * std::expm1(-2.0 * beta_a * dt_s));
}

}  // namespace

// N-27
void NavigationProcessNoise::set_motion(const ReferenceGrade& grade, const NavigationState& state,
                                        const InertialRates& manoeuvre) noexcept {
  const double lean_variance = grade.lean_sd_rad * grade.lean_sd_rad;
  // Gravity's standard value does: the rest is a hundredth of what a manoeuvre accelerates by.
  const Vector3d acceleration_b = manoeuvre.f_b_mps2 + kMps2PerG * state.C_b_n.row(2).transpose();
  gyro_by_motion = shown_by_motion(manoeuvre.omega_ib_b_radps, grade.scale_sd, lean_variance);
  accel_by_motion = shown_by_motion(acceleration_b, grade.scale_sd,
                                    lean_variance + grade.triad_sd_rad * grade.triad_sd_rad);
}

NavigationDynamics error_dynamics(const NavigationState& state, const InertialRates& rates) noexcept {
  const LocalEarth earth(state.position);
  const Vector3d& v = state.v_n_mps;
  const Vector3d& w_ie = earth.w_ie;
  const Vector3d w_en = earth.transport_rate(v);
  const Vector3d f_n = state.C_b_n * rates.f_b_mps2;

  const Matrix3d w_en_by_r = transport_rate_by_position(earth, v);
  const Matrix3d w_en_by_v = transport_rate_by_velocity(earth);
  const Matrix3d w_ie_by_r = earth_rate_by_position(earth);
  Matrix3d gravity_by_r = Matrix3d::Zero();
  gravity_by_r(2, 0) = earth.gravity.latitude_slope_mps2 / earth.M;
  gravity_by_r(2, 2) = -earth.gravity.height_slope_per_s2;

  NavigationDynamics F = NavigationDynamics::Zero();
  // N-21
  block(F, kPositionError, kPositionError) = position_feedback(earth, v);
  block(F, kPositionError, kVelocityError).setIdentity();
  // N-23: -(dw) x v = [v x] dw
  block(F, kVelocityError, kPositionError) = skew(v) * (2.0 * w_ie_by_r + w_en_by_r) + gravity_by_r;
  block(F, kVelocityError, kVelocityError) = -skew(2.0 * w_ie + w_en) + skew(v) * w_en_by_v;
  block(F, kVelocityError, kAttitudeError) = -skew(f_n);
  block(F, kVelocityError, kAccelBiasError) = -state.C_b_n;
  // N-24
  block(F, kAttitudeError, kPositionError) = -(w_ie_by_r + w_en_by_r);
  block(F, kAttitudeError, kVelocityError) = -w_en_by_v;
  block(F, kAttitudeError, kAttitudeError) = -skew(w_ie + w_en);
  block(F, kAttitudeError, kGyroBiasError) = -state.C_b_n;
  return F;
}

NavigationTransition transition(const NavigationState& state, const InertialRates& rates,
                                const NavigationProcessNoise& noise, double dt_s) noexcept {
  const NavigationDynamics F = error_dynamics(state, rates);
  const double beta_g = decay_rate(noise.gyro_bias);
  const double beta_a = decay_rate(noise.accel_bias);
  NavigationTransition out;
  // N-25
  out.kinematic_rows = dt_s * F + (0.5 * dt_s * dt_s) * squared(F, beta_g, beta_a);
  out.kinematic_rows.diagonal().array() += 1.0;
  out.gyro_bias_decay = std::exp(-beta_g * dt_s);
  out.accel_bias_decay = std::exp(-beta_a * dt_s);
  set_process_covariance(white_noise(state, noise), noise, beta_g, beta_a, dt_s, out);
  return out;
}

// N-20
void inject(NavigationState& state, const NavigationErrorVector& error) noexcept {
  const double cos_L = std::cos(state.position.latitude_rad);
  const Curvature curvature = curvature_of(std::sin(state.position.latitude_rad), cos_L);
  const double height = state.position.height_m;
  state.position.latitude_rad += error(kPositionError) / (curvature.meridian_m + height);
  state.position.longitude_rad += error(kPositionError + 1) / ((curvature.transverse_m + height) * cos_L);
  state.position.height_m -= error(kPositionError + 2);
  state.v_n_mps += error.segment<3>(kVelocityError);
  state.C_b_n = tidied(exp_so3(error.segment<3>(kAttitudeError)) * state.C_b_n);
  state.gyro_bias_b_radps += error.segment<3>(kGyroBiasError);
  state.accel_bias_b_mps2 += error.segment<3>(kAccelBiasError);
}

// N-20
NavigationErrorVector error_between(const NavigationState& truth, const NavigationState& estimate) noexcept {
  const LocalEarth earth(estimate.position);
  NavigationErrorVector error;
  error(kPositionError) = (truth.position.latitude_rad - estimate.position.latitude_rad) * earth.M;
  error(kPositionError + 1) =
      wrapped_angle(truth.position.longitude_rad - estimate.position.longitude_rad) * earth.N * earth.cos_L;
  error(kPositionError + 2) = -(truth.position.height_m - estimate.position.height_m);
  error.segment<3>(kVelocityError) = truth.v_n_mps - estimate.v_n_mps;
  error.segment<3>(kAttitudeError) = log_so3(truth.C_b_n * estimate.C_b_n.transpose());
  error.segment<3>(kGyroBiasError) = truth.gyro_bias_b_radps - estimate.gyro_bias_b_radps;
  error.segment<3>(kAccelBiasError) = truth.accel_bias_b_mps2 - estimate.accel_bias_b_mps2;
  return error;
}

}  // namespace imuscope
