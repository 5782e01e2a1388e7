#include "estimation/navigation/antenna.h"

#include "estimation/navigation/local_earth.h"
#include "estimation/navigation/so3.h"

namespace imuscope {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// N-34
AntennaMatrix antenna_in_position(const NavigationState& state, const InertialRates& measured,
                                  const Vector3d& r_ba_b_m) noexcept {
  const LocalEarth earth(state.position);
  const Vector3d w_eb_n = state.C_b_n * compensated(measured, state).omega_ib_b_radps - earth.w_ie;
  AntennaMatrix H;
  H.middleCols<3>(kAntennaLeverArmError) = state.C_b_n;
  H.col(kReceiverLatencyError) = -(state.v_n_mps + w_eb_n.cross(state.C_b_n * r_ba_b_m));
  return H;
}

// N-35
AntennaMatrix antenna_in_velocity(const NavigationState& state, const InertialRates& measured,
                                  const Vector3d& r_ba_b_m) noexcept {
  const LocalEarth earth(state.position);
  const InertialRates rates = compensated(measured, state);
  const Matrix3d& C = state.C_b_n;
  const Vector3d w_en = earth.transport_rate(state.v_n_mps);
  const Vector3d w_nb_n = C * rates.omega_ib_b_radps - earth.w_ie - w_en;
  const Vector3d swing_n = C * rates.omega_ib_b_radps.cross(r_ba_b_m);
  const Vector3d acceleration_n =
      C * rates.f_b_mps2 + earth.gravity_n() - (2.0 * earth.w_ie + w_en).cross(state.v_n_mps);
  AntennaMatrix H;
  H.middleCols<3>(kAntennaLeverArmError) = C * skew(rates.omega_ib_b_radps) - skew(earth.w_ie) * C;
  H.col(kReceiverLatencyError) =
      -(acceleration_n + w_nb_n.cross(swing_n) - earth.w_ie.cross(w_nb_n.cross(C * r_ba_b_m)));
  return H;
}

// N-37
void inject(AntennaState& antenna, const AntennaErrorVector& error) noexcept {
  antenna.r_ba_b_m += error.segment<3>(kAntennaLeverArmError);
  antenna.latency_s += error(kReceiverLatencyError);
}

}  // namespace imuscope
