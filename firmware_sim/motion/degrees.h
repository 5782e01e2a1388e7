#pragma once

/// Degrees, which stand in configurations, in telegrams and in the files of the truth.

#include <cmath>
#include <numbers>

namespace imusim {

inline constexpr double kRadPerDeg = std::numbers::pi / 180.0;
inline constexpr double kDegPerRad = 180.0 / std::numbers::pi;

/// An angle as degrees from 0 to 360.
inline double wrapped_deg(double angle_rad) {
  const double angle = std::fmod(angle_rad * kDegPerRad, 360.0);
  return angle < 0.0 ? angle + 360.0 : angle;
}

}  // namespace imusim
