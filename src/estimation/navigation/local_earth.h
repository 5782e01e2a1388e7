#pragma once

/// Everything that the mechanisation and its error model need to know of the Earth at one place, from a
/// single sine and cosine. Core: no allocation, noexcept.

#include <cmath>

#include "estimation/navigation/gravity.h"
#include "estimation/navigation/wgs84.h"

namespace imuscope {

struct LocalEarth {
  explicit LocalEarth(const GeodeticPosition& position) noexcept
      : sin_L(std::sin(position.latitude_rad)),
        cos_L(std::cos(position.latitude_rad)),
        tan_L(sin_L / cos_L),
        curvature(curvature_of(sin_L, cos_L)),
        M(curvature.meridian_m + position.height_m),
        N(curvature.transverse_m + position.height_m),
        gravity(normal_gravity_of(sin_L, cos_L, position.height_m)),
        w_ie(kEarthRate_radps * cos_L, 0.0, -kEarthRate_radps * sin_L) {}

  /// N-9
  [[nodiscard]] Eigen::Vector3d transport_rate(const Eigen::Vector3d& v_n_mps) const noexcept {
    return {v_n_mps.y() / N, -v_n_mps.x() / M, -v_n_mps.y() * tan_L / N};
  }
  /// Gravity as a vector in NED.
  [[nodiscard]] Eigen::Vector3d gravity_n() const noexcept { return {0.0, 0.0, gravity.g_mps2}; }

  double sin_L, cos_L, tan_L;
  Curvature curvature;
  double M, N;  ///< radii of curvature plus height
  Gravity gravity;
  Eigen::Vector3d w_ie;  ///< Earth rate in NED
};

}  // namespace imuscope
