#include "navigation/strapdown.h"

#include <cmath>

#include "navigation/gravity.h"
#include "navigation/so3.h"

namespace imuscope {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// One Newton step towards the nearest orthonormal matrix: removes the rounding of one product.
Matrix3d tidied(const Matrix3d& C) noexcept {
  return 0.5 * C * (3.0 * Matrix3d::Identity() - C.transpose() * C);
}

InertialIncrement increment(const InertialRates& first, const InertialRates& second,
                            const Vector3d& mean_omega, const Vector3d& mean_f, double dt_s) noexcept {
  const double dt2_12 = dt_s * dt_s / 12.0;
  const Vector3d& w0 = first.omega_ib_b_radps;
  const Vector3d& w1 = second.omega_ib_b_radps;
  const Vector3d& f0 = first.f_b_mps2;
  const Vector3d& f1 = second.f_b_mps2;
  InertialIncrement out;
  out.dt_s = dt_s;
  // N-10: the last term is coning.
  out.rotation_rad = mean_omega * dt_s + dt2_12 * w0.cross(w1);
  // N-11: rotation during the interval to second order, then sculling.
  const Vector3d theta = mean_omega * dt_s;
  const Vector3d turned = theta.cross(mean_f);
  out.delta_v_b_mps =
      dt_s * (mean_f + 0.5 * turned + theta.cross(turned) / 6.0) + dt2_12 * (w0.cross(f1) + f0.cross(w1));
  return out;
}

}  // namespace

InertialIncrement increment_from_samples(const InertialRates& start, const InertialRates& end,
                                         double dt_s) noexcept {
  return increment(start, end, 0.5 * (start.omega_ib_b_radps + end.omega_ib_b_radps),
                   0.5 * (start.f_b_mps2 + end.f_b_mps2), dt_s);
}

InertialIncrement increment_from_means(const InertialRates& previous_mean, const InertialRates& mean,
                                       double dt_s) noexcept {
  return increment(previous_mean, mean, mean.omega_ib_b_radps, mean.f_b_mps2, dt_s);
}

void propagate(NavigationState& state, const InertialIncrement& inc) noexcept {
  const double dt = inc.dt_s;
  const Vector3d v0 = state.v_n_mps;
  const Vector3d w_en_start = transport_rate_n(state.position, v0);

  // N-12: the middle of the interval, with the velocity carried there by the force of this interval.
  const Gravity gravity_start = normal_gravity(state.position.latitude_rad, state.position.height_m);
  const Vector3d w_ie_start = earth_rate_n(state.position.latitude_rad);
  const Vector3d coriolis_start = (2.0 * w_ie_start + w_en_start).cross(v0);
  const Vector3d v_mid = v0 + 0.5 * (state.C_b_n * inc.delta_v_b_mps +
                                     dt * (Vector3d(0.0, 0.0, gravity_start.g_mps2) - coriolis_start));
  const Curvature k = curvature_at(state.position.latitude_rad);
  GeodeticPosition middle = state.position;
  middle.latitude_rad += 0.5 * dt * v_mid.x() / (k.meridian_m + middle.height_m);
  middle.height_m -= 0.5 * dt * v_mid.z();
  const Gravity gravity = normal_gravity(middle.latitude_rad, middle.height_m);
  const Vector3d w_ie = earth_rate_n(middle.latitude_rad);
  const Vector3d w_en = transport_rate_n(middle, v_mid);

  // N-13: the navigation frame turns by zeta; half of it has happened in the mean of the interval.
  const Vector3d zeta = (w_ie + w_en) * dt;
  const Vector3d dv_n = state.C_b_n * inc.delta_v_b_mps;
  state.v_n_mps = v0 + dv_n - 0.5 * zeta.cross(dv_n) +
                  dt * (Vector3d(0.0, 0.0, gravity.g_mps2) - (2.0 * w_ie + w_en).cross(v_mid));

  // N-14: mid-point position, with the radii of the interval's middle.
  const Vector3d v_mean = 0.5 * (v0 + state.v_n_mps);
  const Curvature k_mid = curvature_at(middle.latitude_rad);
  state.position.latitude_rad += dt * v_mean.x() / (k_mid.meridian_m + middle.height_m);
  state.position.longitude_rad +=
      dt * v_mean.y() / ((k_mid.transverse_m + middle.height_m) * std::cos(middle.latitude_rad));
  state.position.height_m -= dt * v_mean.z();

  // N-15, N-16
  state.C_b_n = tidied(exp_so3(-zeta) * state.C_b_n * exp_so3(inc.rotation_rad));
}

}  // namespace imuscope
