#pragma once

/// The whole transition of the navigation's errors, as an oracle multiplies it. For programs that link navigation.

#include "estimation/navigation/error_model.h"

namespace imuscope::test {

inline NavigationErrorCovariance full_matrix(const NavigationTransition& transition) {
  NavigationErrorCovariance Phi = NavigationErrorCovariance::Zero();
  Phi.topRows<kNavigationKinematicSize>() = transition.kinematic_rows;
  Phi.diagonal().segment<3>(kGyroBiasError).setConstant(transition.gyro_bias_decay);
  Phi.diagonal().segment<3>(kAccelBiasError).setConstant(transition.accel_bias_decay);
  return Phi;
}

}  // namespace imuscope::test
