#include "estimation/navigation/gravity.h"

#include <cmath>

#include "estimation/navigation/wgs84.h"

namespace imuscope {

namespace {
// NIMA TR8350.2 table 3.4.
constexpr double kEquatorGravity_mps2 = 9.7803253359;
constexpr double kSomigliana = 0.00193185265241;
/// omega^2 a^2 b / GM
constexpr double kRotationRatio = 0.00344978650684;
}  // namespace

// N-8
Gravity normal_gravity_of(double sin_latitude, double cos_latitude, double height_m) noexcept {
  constexpr double a = kWgs84SemiMajorAxis_m;
  constexpr double f = kWgs84Flattening;
  constexpr double e2 = kWgs84EccentricitySquared;
  const double s2 = sin_latitude * sin_latitude;
  const double ds2 = 2.0 * sin_latitude * cos_latitude;  // d(s^2)/dL
  const double w2 = 1.0 - e2 * s2;
  const double w = std::sqrt(w2);

  const double g0 = kEquatorGravity_mps2 * (1.0 + kSomigliana * s2) / w;
  const double g0_slope = ds2 * (kEquatorGravity_mps2 * kSomigliana / w + 0.5 * e2 * g0 / w2);

  const double first = -2.0 / a * (1.0 + f + kRotationRatio - 2.0 * f * s2);
  const double second = 3.0 / (a * a);
  const double height_factor = 1.0 + first * height_m + second * height_m * height_m;
  const double height_factor_slope = 4.0 * f / a * ds2 * height_m;

  return {g0 * height_factor, g0_slope * height_factor + g0 * height_factor_slope,
          g0 * (first + 2.0 * second * height_m)};
}

Gravity normal_gravity(double latitude_rad, double height_m) noexcept {
  return normal_gravity_of(std::sin(latitude_rad), std::cos(latitude_rad), height_m);
}

}  // namespace imuscope
