#include "estimation/navigation/strapdown.h"

#include "estimation/navigation/local_earth.h"
#include "estimation/navigation/so3.h"

namespace imuscope {

namespace {

using Eigen::Vector3d;

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
  const Vector3d dv_n = state.C_b_n * inc.delta_v_b_mps;

  // N-12: the middle of the interval, with the velocity carried there by the force of this interval.
  const LocalEarth start(state.position);
  const Vector3d coriolis = (2.0 * start.w_ie + start.transport_rate(v0)).cross(v0);
  const Vector3d v_mid = v0 + 0.5 * (dv_n + dt * (start.gravity_n() - coriolis));
  GeodeticPosition middle_position = state.position;
  middle_position.latitude_rad += 0.5 * dt * v_mid.x() / start.M;
  middle_position.height_m -= 0.5 * dt * v_mid.z();
  const LocalEarth middle(middle_position);
  const Vector3d w_en = middle.transport_rate(v_mid);

  // N-13: the navigation frame turns by zeta; half of it has happened in the mean of the interval.
  const Vector3d zeta = (middle.w_ie + w_en) * dt;
  state.v_n_mps = v0 + dv_n - 0.5 * zeta.cross(dv_n) +
                  dt * (middle.gravity_n() - (2.0 * middle.w_ie + w_en).cross(v_mid));

  // N-14: mid-point position, with the radii of the interval's middle.
  const Vector3d v_mean = 0.5 * (v0 + state.v_n_mps);
  state.position.latitude_rad += dt * v_mean.x() / middle.M;
  state.position.longitude_rad += dt * v_mean.y() / (middle.N * middle.cos_L);
  state.position.height_m -= dt * v_mean.z();

  // N-15, N-16
  state.C_b_n = tidied(exp_so3(-zeta) * state.C_b_n * exp_so3(inc.rotation_rad));
}

}  // namespace imuscope
