#pragma once

/// The WGS-84 ellipsoid. Source: NIMA TR8350.2, third edition, amendment 1 (2000).

#include <cmath>

namespace imuscope {

inline constexpr double kWgs84SemiMajorAxis_m = 6378137.0;       ///< TR8350.2 table 3.1
inline constexpr double kWgs84Flattening = 1.0 / 298.257223563;  ///< TR8350.2 table 3.1
inline constexpr double kWgs84EccentricitySquared = kWgs84Flattening * (2.0 - kWgs84Flattening);

/// Radii of curvature on the ellipsoid, without the height.
struct RadiiOfCurvature {
  double meridian_m;    ///< north-south
  double transverse_m;  ///< east-west
};

[[nodiscard]] inline RadiiOfCurvature radii_of_curvature(double latitude_rad) noexcept {
  const double sine = std::sin(latitude_rad);
  const double w2 = 1.0 - kWgs84EccentricitySquared * sine * sine;
  const double transverse_m = kWgs84SemiMajorAxis_m / std::sqrt(w2);
  return {transverse_m * (1.0 - kWgs84EccentricitySquared) / w2, transverse_m};
}

}  // namespace imuscope
