#pragma once

/// Whether a sample of an IMU can be used at all.

#include <cmath>

#include "sample/sample.h"

namespace imuscope {

/// @return false where a rate or a force is infinite or no number
inline bool is_finite(const ImuData& imu) noexcept {
  bool finite = true;
  for (std::size_t i = 0; i < 3; ++i)
    finite = finite && std::isfinite(imu.omega_radps[i]) && std::isfinite(imu.f_mps2[i]);
  return finite;
}

}  // namespace imuscope
